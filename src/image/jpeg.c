#include "image/jpeg.h"

#include <string.h>

/* T.81 table K.1: luminance quantisation, natural order. */
static const uint8_t base_quantiser[64] = {
    16, 11, 10, 16, 24,  40,  51,  61,  12, 12, 14, 19, 26,  58,  60,  55,
    14, 13, 16, 24, 40,  57,  69,  56,  14, 17, 22, 29, 51,  87,  80,  62,
    18, 22, 37, 56, 68,  109, 103, 77,  24, 35, 55, 64, 81,  104, 113, 92,
    49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99,
};

/* Natural index of the k-th coefficient in zigzag order (T.81 figure 5). */
static const uint8_t zigzag[64] = {
    0,  1,  8,  16, 9,  2,  3,  10, 17, 24, 32, 25, 18, 11, 4,  5,  12, 19, 26, 33, 40, 48,
    41, 34, 27, 20, 13, 6,  7,  14, 21, 28, 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23,
    30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63,
};

/* T.81 tables K.3 and K.5: luminance Huffman codes as counts per length and values in code order.
 */
static const uint8_t dc_counts[16] = {0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0};
static const uint8_t dc_values[12] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
static const uint8_t ac_counts[16] = {0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 0x7d};
static const uint8_t ac_values[162] = {
    0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61,
    0x07, 0x22, 0x71, 0x14, 0x32, 0x81, 0x91, 0xa1, 0x08, 0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52,
    0xd1, 0xf0, 0x24, 0x33, 0x62, 0x72, 0x82, 0x09, 0x0a, 0x16, 0x17, 0x18, 0x19, 0x1a, 0x25,
    0x26, 0x27, 0x28, 0x29, 0x2a, 0x34, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45,
    0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64,
    0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x83,
    0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99,
    0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6,
    0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3,
    0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe1, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8,
    0xe9, 0xea, 0xf1, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa,
};

enum { END_OF_BLOCK = 0x00, SIXTEEN_ZEROS = 0xf0, HEADER_BYTES = 400, BLOCKS_BYTES_MAX = 512 };

size_t fv_jpeg_capacity(int32_t width, int32_t height)
{
    return HEADER_BYTES + BLOCKS_BYTES_MAX + (size_t)width * (size_t)height;
}

static void put_byte(struct fv_jpeg *jpeg, uint8_t *output, uint32_t byte)
{
    if (jpeg->used < jpeg->capacity) {
        output[jpeg->used++] = (uint8_t)byte;
    } else {
        jpeg->overflow = true;
    }
}

static void put_word(struct fv_jpeg *jpeg, uint8_t *output, uint32_t word)
{
    put_byte(jpeg, output, word >> 8);
    put_byte(jpeg, output, word & 255);
}

/* Entropy-coded bits, most significant first; a 0xff byte is followed by a stuffed zero. count
 * <= 16. */
static void put_bits(struct fv_jpeg *jpeg, uint8_t *output, uint32_t bits, uint32_t count)
{
    jpeg->bit_buffer = (jpeg->bit_buffer << count) | (bits & ((1u << count) - 1));
    jpeg->bit_count += count;
    while (jpeg->bit_count >= 8) {
        const uint32_t byte = (jpeg->bit_buffer >> (jpeg->bit_count - 8)) & 255;
        put_byte(jpeg, output, byte);
        if (byte == 255) put_byte(jpeg, output, 0);
        jpeg->bit_count -= 8;
    }
}

/* The codes of all symbols. */
struct codes {
    uint16_t code[256];
    uint8_t length[256]; /* 0: no such symbol */
};

/* The canonical code (T.81 annex C). */
static void make_codes(const uint8_t counts[16], const uint8_t *values, struct codes *codes)
{
    uint32_t code = 0, index = 0;
    memset(codes, 0, sizeof *codes);
    for (uint32_t length = 1; length <= 16; length++) {
        for (uint32_t i = 0; i < counts[length - 1]; i++, index++, code++) {
            codes->code[values[index]] = (uint16_t)code;
            codes->length[values[index]] = (uint8_t)length;
        }
        code <<= 1;
    }
}

static void put_symbol(struct fv_jpeg *jpeg, uint8_t *output, const struct codes *codes,
                       uint8_t symbol)
{
    put_bits(jpeg, output, codes->code[symbol], codes->length[symbol]);
}

static void put_table(struct fv_jpeg *jpeg, uint8_t *output, uint32_t table_class,
                      const uint8_t counts[16], const uint8_t *values, uint32_t value_count)
{
    put_word(jpeg, output, 0xffc4);
    put_word(jpeg, output, 2 + 1 + 16 + value_count);
    put_byte(jpeg, output, table_class << 4);
    for (uint32_t i = 0; i < 16; i++)
        put_byte(jpeg, output, counts[i]);
    for (uint32_t i = 0; i < value_count; i++)
        put_byte(jpeg, output, values[i]);
}

static void put_headers(struct fv_jpeg *jpeg, uint8_t *output)
{
    static const uint8_t jfif[] = {0xff, 0xd8, 0xff, 0xe0, 0, 16, 'J', 'F', 'I', 'F',
                                   0,    1,    1,    0,    0, 1,  0,   1,   0,   0};
    for (uint32_t i = 0; i < sizeof jfif; i++)
        put_byte(jpeg, output, jfif[i]);
    put_word(jpeg, output, 0xffdb);
    put_word(jpeg, output, 2 + 1 + 64);
    put_byte(jpeg, output, 0);
    for (uint32_t k = 0; k < 64; k++)
        put_byte(jpeg, output, jpeg->quantiser[zigzag[k]]);
    put_word(jpeg, output, 0xffc0); /* baseline frame: 8 bits, one component without subsampling */
    put_word(jpeg, output, 8 + 3);
    put_byte(jpeg, output, 8);
    put_word(jpeg, output, (uint32_t)jpeg->height);
    put_word(jpeg, output, (uint32_t)jpeg->width);
    static const uint8_t component[] = {1, 1, 0x11, 0};
    for (uint32_t i = 0; i < sizeof component; i++)
        put_byte(jpeg, output, component[i]);
    put_table(jpeg, output, 0, dc_counts, dc_values, sizeof dc_values);
    put_table(jpeg, output, 1, ac_counts, ac_values, sizeof ac_values);
    static const uint8_t scan[] = {0xff, 0xda, 0, 8, 1, 1, 0x00, 0, 63, 0};
    for (uint32_t i = 0; i < sizeof scan; i++)
        put_byte(jpeg, output, scan[i]);
}

void fv_jpeg_start(struct fv_jpeg *jpeg, int32_t width, int32_t height, uint32_t quality,
                   uint8_t *output, size_t capacity)
{
    memset(jpeg, 0, sizeof *jpeg);
    jpeg->width = width;
    jpeg->height = height;
    jpeg->blocks = (uint32_t)((width + 7) / 8) * (uint32_t)((height + 7) / 8);
    jpeg->capacity = capacity;
    /* libjpeg's meaning of quality: 50 leaves the table as it is. */
    const uint32_t percent = quality < 50 ? 5000 / quality : 200 - 2 * quality;
    for (uint32_t i = 0; i < 64; i++) {
        const uint32_t value = (base_quantiser[i] * percent + 50) / 100;
        jpeg->quantiser[i] = (uint16_t)(value < 1 ? 1 : value > 255 ? 255 : value);
    }
    put_headers(jpeg, output);
}

/* One-dimensional DCT-II of 8 values `step` apart, in place, by even-odd decomposition. Constants
 * are cos(k pi / 16) in 13 fractional bits; the orthonormal factor 1/2 (1/(2 sqrt 2) for k = 0) is
 * in `shift`. */
static void dct_8(int32_t *v, int step, int shift)
{
    enum { C1 = 8035, C2 = 7568, C3 = 6811, C4 = 5793, C5 = 4551, C6 = 3135, C7 = 1598 };
    const int32_t s07 = v[0] + v[7 * step], d07 = v[0] - v[7 * step];
    const int32_t s16 = v[step] + v[6 * step], d16 = v[step] - v[6 * step];
    const int32_t s25 = v[2 * step] + v[5 * step], d25 = v[2 * step] - v[5 * step];
    const int32_t s34 = v[3 * step] + v[4 * step], d34 = v[3 * step] - v[4 * step];
    const int32_t round = 1 << (shift - 1);
    v[0] = (C4 * (s07 + s16 + s25 + s34) + round) >> shift;
    v[4 * step] = (C4 * (s07 - s16 - s25 + s34) + round) >> shift;
    v[2 * step] = (C2 * (s07 - s34) + C6 * (s16 - s25) + round) >> shift;
    v[6 * step] = (C6 * (s07 - s34) - C2 * (s16 - s25) + round) >> shift;
    v[step] = (C1 * d07 + C3 * d16 + C5 * d25 + C7 * d34 + round) >> shift;
    v[3 * step] = (C3 * d07 - C7 * d16 - C1 * d25 - C5 * d34 + round) >> shift;
    v[5 * step] = (C5 * d07 - C1 * d16 + C7 * d25 + C3 * d34 + round) >> shift;
    v[7 * step] = (C7 * d07 - C5 * d16 + C3 * d25 - C1 * d34 + round) >> shift;
}

static void load_block(const struct fv_jpeg *jpeg, const struct fv_plane *picture,
                       int32_t values[64])
{
    const int32_t blocks_per_row = (jpeg->width + 7) / 8;
    const int32_t x0 = (int32_t)jpeg->block % blocks_per_row * 8;
    const int32_t y0 = (int32_t)jpeg->block / blocks_per_row * 8;
    for (int32_t y = 0; y < 8; y++) {
        const uint8_t *row =
            fv_plane_row(picture, y0 + y < jpeg->height ? y0 + y : jpeg->height - 1);
        for (int32_t x = 0; x < 8; x++) {
            const int32_t column = x0 + x < jpeg->width ? x0 + x : jpeg->width - 1;
            values[8 * y + x] = row[column] - 128;
        }
    }
}

/* A coefficient is coded as the symbol (zeros before it, bits of its magnitude) and that many bits.
 */
static void put_coefficient(struct fv_jpeg *jpeg, uint8_t *output, const struct codes *codes,
                            uint32_t zeros, int32_t value)
{
    const uint32_t magnitude = (uint32_t)(value < 0 ? -value : value),
                   size = magnitude == 0 ? 0 : 32 - (uint32_t)__builtin_clz(magnitude);
    put_symbol(jpeg, output, codes, (uint8_t)(zeros << 4 | size));
    if (size > 0) put_bits(jpeg, output, (uint32_t)(value < 0 ? value - 1 : value), size);
}

static void encode_block(struct fv_jpeg *jpeg, const struct fv_plane *picture,
                         const struct codes *dc, const struct codes *ac, uint8_t *output)
{
    int32_t values[64];
    load_block(jpeg, picture, values);
    for (int i = 0; i < 8; i++)
        dct_8(values + 8 * i, 1, 11); /* rows: 2^3 kept as guard bits */
    for (int i = 0; i < 8; i++)
        dct_8(values + i, 8, 13); /* columns; both halves: 2^4 in all */
    uint32_t zeros = 0;
    for (uint32_t k = 0; k < 64; k++) {
        const int32_t divisor = jpeg->quantiser[zigzag[k]] * 16;
        const int32_t value = values[zigzag[k]], twice = 2 * (value < 0 ? -value : value);
        int32_t level = twice < divisor ? 0 : (twice + divisor) / (2 * divisor); /* mostly 0 */
        if (level > 1023) level = 1023; /* the most that baseline AC codes hold */
        if (value < 0) level = -level;
        if (k == 0) {
            put_coefficient(jpeg, output, dc, 0, level - jpeg->last_dc);
            jpeg->last_dc = level;
        } else if (level == 0) {
            zeros++;
        } else {
            for (; zeros >= 16; zeros -= 16)
                put_symbol(jpeg, output, ac, SIXTEEN_ZEROS);
            put_coefficient(jpeg, output, ac, zeros, level);
            zeros = 0;
        }
    }
    if (zeros > 0) put_symbol(jpeg, output, ac, END_OF_BLOCK);
}

bool fv_jpeg_encode(struct fv_jpeg *jpeg, const struct fv_plane *picture, uint32_t block_count,
                    uint8_t *output)
{
    struct codes dc, ac;
    make_codes(dc_counts, dc_values, &dc);
    make_codes(ac_counts, ac_values, &ac);
    for (uint32_t i = 0; i < block_count && jpeg->block < jpeg->blocks && !jpeg->overflow; i++) {
        encode_block(jpeg, picture, &dc, &ac, output);
        jpeg->block++;
    }
    if (jpeg->overflow) return true;
    if (jpeg->block < jpeg->blocks) return false;
    if (jpeg->bit_count > 0) put_bits(jpeg, output, 127, 8 - jpeg->bit_count); /* pad with ones */
    put_word(jpeg, output, 0xffd9);
    return true;
}
