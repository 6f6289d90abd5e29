/* The kernels: small stateless integer functions, each with a plain C variant and faster ones per
 * instruction set.
 *
 * Callers hold a pointer to a struct fv_kernels and call `kernels->name(...)`; which variant that
 * is was decided once, at init. Every variant of a kernel gives the same bits (tests/kernels proves
 * it), so results do not depend on the choice. The contract of each kernel (shapes, alignment,
 * over-read) is the comment of its function type in contracts/. */
#ifndef FOVEA_KERNELS_KERNELS_H
#define FOVEA_KERNELS_KERNELS_H

#include <stdint.h>

#include "kernels/cpu.h"

#include "kernels/contracts/corner.h"
#include "kernels/contracts/edge.h"
#include "kernels/contracts/fast.h"
#include "kernels/contracts/filter.h"
#include "kernels/contracts/grey.h"
#include "kernels/contracts/hamming.h"
#include "kernels/contracts/orb.h"
#include "kernels/contracts/pyramid.h"
#include "kernels/contracts/remap.h"
#include "kernels/contracts/response.h"
#include "kernels/contracts/scale.h"
#include "kernels/contracts/squares.h"
#include "kernels/contracts/surf.h"
#include "kernels/contracts/nn.h"

#ifdef __cplusplus
extern "C" {
#endif

/* FV_VARIANTS(do, name, columns...): do(name, isa, bit) for each variant of a row that this
 * architecture can have, in ascending order, without C. */
#define FV_WHEN_0(...)
#define FV_WHEN_1(...) __VA_ARGS__
#if defined(__x86_64__)
#define FV_VARIANTS(do_, name, s4, a2, ev, av, a5, a5v, a5i, ne, dp, mm)                           \
    FV_WHEN_##s4(do_(name, sse4, FV_ISA_SSE4)) FV_WHEN_##a2(do_(name, avx2, FV_ISA_AVX2))          \
        FV_WHEN_##ev(do_(name, evexvnni, FV_ISA_EVEXVNNI))                                         \
            FV_WHEN_##av(do_(name, avxvnni, FV_ISA_AVXVNNI))                                       \
                FV_WHEN_##a5(do_(name, avx512, FV_ISA_AVX512))                                     \
                    FV_WHEN_##a5v(do_(name, avx512vnni, FV_ISA_AVX512VNNI))                        \
                        FV_WHEN_##a5i(do_(name, avx512icl, FV_ISA_AVX512ICL))
#elif defined(__aarch64__)
#define FV_VARIANTS(do_, name, s4, a2, ev, av, a5, a5v, a5i, ne, dp, mm)                           \
    FV_WHEN_##ne(do_(name, neon, FV_ISA_NEON)) FV_WHEN_##dp(do_(name, dotprod, FV_ISA_DOTPROD))    \
        FV_WHEN_##mm(do_(name, i8mm, FV_ISA_I8MM))
#else
#define FV_VARIANTS(do_, name, ...)
#endif

/* Declarations: a variant without a row lacks a prototype, a row without its variant does not link.
 */
#define FV_DECLARE(name, isa, bit) fv_k_##name##_fn fv_k_##name##__##isa;
#define FV_KERNEL(name, ...) FV_DECLARE(name, c, 0) FV_VARIANTS(FV_DECLARE, name, __VA_ARGS__)
#include "kernels/kernels.def"
#undef FV_KERNEL

struct fv_kernels {
    enum fv_cpu_set set; /* what was picked, at most what was asked for */
    uint32_t isas;       /* enum fv_isa bits in use */
#define FV_KERNEL(name, ...) fv_k_##name##_fn *name;
#include "kernels/kernels.def"
#undef FV_KERNEL
};

/* Fill the table: C first, then every better variant that the processor has, up to the set `cap`. A
 * set that the processor lacks falls to what it has. Lives where the caller puts it (the runtime's
 * block). Init-only. */
void fv_kernels_init(struct fv_kernels *kernels, enum fv_cpu_set cap);

#ifdef __cplusplus
}
#endif
#endif
