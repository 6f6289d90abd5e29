/* What the checks and benchmarks of kernels share: seeded fills, guarded buffers, comparison.
 *
 * For each row of kernels.def, two functions (in tests/kernels/check_<family>.c):
 *   void check_<name>(struct check *check, fv_k_<name>_fn *reference, fv_k_<name>_fn *variant)
 *       draws sizes, strides and fills, runs both and compares with check_equal; called for every
 *       variant, many times;
 *   void bench_<name>(struct check *check, fv_k_<name>_fn *variant)
 *       does one image's worth of work (BENCH_WIDTH x BENCH_HEIGHT unless check->size is set to say
 *       otherwise).
 * A failing check prints kernel, variant and seed; `test_kernels --seed S kernel` repeats it. */
#ifndef FOVEA_TESTS_KERNELS_CHECK_H
#define FOVEA_TESTS_KERNELS_CHECK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/elementary.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { BENCH_WIDTH = 752, BENCH_HEIGHT = 480, CHECK_BUFFERS_MAX = 32 };

struct check {
    uint64_t seed;
    uint64_t random;    /* state of the generator */
    const char *kernel; /* name of the row */
    const char *isa;    /* of the variant under test */
    bool failed;
    char size[32]; /* bench: what one call covers, for the report */
    void *kept;    /* bench: inputs made on the first call, freed with the buffers */
    struct {
        uint8_t *pages; /* whole mapping */
        size_t pages_bytes;
        uint8_t *data;
        size_t bytes;
    } buffers[CHECK_BUFFERS_MAX];
    int buffer_count;
};

uint32_t check_random(struct check *check);
/* Uniform in [low, high]. */
int32_t check_between(struct check *check, int32_t low, int32_t high);
/* Zero and bounds of the output of an int8 operator. */
void check_draw_range(struct check *check, int32_t *zero, int32_t *low, int32_t *high);

/* A zeroed buffer in its own mapping, `alignment` (a power of two, at most 64) aligned, with
 * inaccessible pages before and after. At random the end of the buffer (plus `slack` bytes that the
 * kernel may touch by contract) or its start lies at an inaccessible page, so that reading beyond
 * faults; the rest of the pages holds a pattern, so that writing beyond shows. */
void *check_buffer(struct check *check, size_t bytes, size_t alignment, size_t slack);

/* Fill with one of: random bytes, all 0, all 255, random extremes (0 or 255), smooth ramps with
 * noise, few values. */
void check_fill(struct check *check, void *data, size_t bytes);

/* Compare and report the first difference. `what` names the output. */
void check_equal(struct check *check, const char *what, const void *expected, const void *found,
                 size_t bytes);

/* Report a failure of another kind. */
void check_fail(struct check *check, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Give all buffers back; reports any whose guard pattern was overwritten. Called by the harness
 * after each check. */
void check_release(struct check *check);

/* For benchmarks: grey image of BENCH_WIDTH x BENCH_HEIGHT (stride BENCH_STRIDE, slack rows
 * readable), the same on every machine, with edges, texture and noise. Made once. */
enum { BENCH_STRIDE = 832 };
const uint8_t *bench_image(void);
/* Put a real image of that size in its place. */
void bench_image_set(const uint8_t *pixels, size_t stride_bytes);
/* Scratch of at least 8 MiB, 64-byte aligned, for outputs of benchmarks. */
uint8_t *bench_scratch(void);

#define FV_KERNEL(name, ...)                                                                       \
    void check_##name(struct check *, fv_k_##name##_fn *, fv_k_##name##_fn *);                     \
    void bench_##name(struct check *, fv_k_##name##_fn *);
#include "kernels/kernels.def"
#undef FV_KERNEL

/* Rows, for the harness and for tests/bench. */
struct kernel_variant {
    const char *kernel, *isa;
    uint32_t bit;                       /* enum fv_isa, 0: C */
    void (*check)(struct check *check); /* against C, once; does nothing for C itself */
    void (*bench)(struct check *check); /* once */
};
extern const struct kernel_variant kernel_variants[];
extern const int kernel_variant_count;

#ifdef __cplusplus
}
#endif
#endif
