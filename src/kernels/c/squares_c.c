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
