#include "kernels/kernels.h"

/* Products of a query with the trains of a group. */
static void products(int32_t sum[FV_SQUARES_GROUP], const int8_t *query, const uint8_t *group,
                     int32_t words)
{
    for (int32_t i = 0; i < FV_SQUARES_GROUP; i++)
        sum[i] = 0;
    for (int32_t w = 0; w < words; w++, query += 4, group += 4 * FV_SQUARES_GROUP) {
        const int8_t a = query[0], b = query[1], c = query[2], d = query[3];
        for (int32_t i = 0; i < FV_SQUARES_GROUP; i++)
            sum[i] += a * group[4 * i] + b * group[4 * i + 1] + c * group[4 * i + 2] +
                      d * group[4 * i + 3];
    }
}

void fv_k_squares_two_u8__c(int32_t *nearest, int32_t *second, uint32_t *index,
                            const int8_t *queries, int32_t query_count, const uint8_t *trains,
                            const int32_t *bias, int32_t groups, int32_t words)
{
    for (int32_t q = 0; q < query_count; q++) {
        const int8_t *query = queries + (int64_t)q * 4 * words;
        int32_t sum[FV_SQUARES_GROUP];
        nearest[q] = second[q] = INT32_MAX;
        index[q] = 0;
        for (int32_t t = 0; t < groups * FV_SQUARES_GROUP; t++) {
            const int32_t lane = t % FV_SQUARES_GROUP;
            if (lane == 0) products(sum, query, trains + (int64_t)t * 4 * words, words);
            const int32_t v = bias[t] - 2 * sum[lane];
            if (v < nearest[q]) {
                second[q] = nearest[q];
                nearest[q] = v;
                index[q] = (uint32_t)t;
            } else if (v < second[q]) {
                second[q] = v;
            }
        }
    }
}

void fv_k_squares_bound_s16__c(int16_t *rows, int32_t stride, int16_t *least, const int8_t *queries,
                               const uint8_t *trains, const int16_t *half, int32_t groups,
                               int32_t pairs)
{
    for (int32_t q = 0; q < FV_BOUND_QUERIES; q++) {
        const int8_t *query = queries + (int64_t)q * 2 * pairs;
        int16_t *row = rows + (int64_t)q * stride, *lanes = least + (int64_t)q * FV_BOUND_LANES;
        for (int32_t i = 0; i < FV_BOUND_LANES; i++)
            lanes[i] = INT16_MAX;
        for (int32_t t = 0; t < groups * FV_BOUND_GROUP; t++) {
            const uint8_t *train =
                trains +
                ((int64_t)(t / FV_BOUND_GROUP) * pairs * FV_BOUND_GROUP + t % FV_BOUND_GROUP) * 2;
            int32_t sum = 0;
            for (int32_t p = 0; p < pairs; p++) {
                const uint8_t *two = train + (int64_t)p * 2 * FV_BOUND_GROUP;
                sum += query[2 * p] * (two[0] - FV_BOUND_ZERO) +
                       query[2 * p + 1] * (two[1] - FV_BOUND_ZERO);
            }
            row[t] = (int16_t)(half[t] - sum);
            if (row[t] < lanes[t % FV_BOUND_LANES]) lanes[t % FV_BOUND_LANES] = row[t];
        }
    }
}

int32_t fv_k_squares_below_s16__c(uint16_t *indices, const int16_t *row, int32_t count,
                                  int16_t limit)
{
    int32_t found = 0;
    for (int32_t i = 0; i < count; i++)
        if (row[i] <= limit) indices[found++] = (uint16_t)i;
    return found;
}

void fv_k_squares_some_u8__c(int32_t *distances, const uint8_t *query, const uint8_t *descriptors,
                             int32_t bytes, const uint16_t *indices, int32_t count)
{
    for (int32_t k = 0; k < count; k++) {
        const uint8_t *other = descriptors + (int64_t)bytes * indices[k];
        int32_t sum = 0;
        for (int32_t i = 0; i < bytes; i++)
            sum += (query[i] - other[i]) * (query[i] - other[i]);
        distances[k] = sum;
    }
}
