/* Which instruction sets this processor has, and which of them may be used.
 *
 * A *set* is what a person names: FOVEA_CPU=c|sse4|avx2|avxvnni|avx512|neon|dotprod|i8mm. An *ISA*
 * is what one kernel variant needs, a bit each. A set allows every ISA up to it; the set avx512
 * also allows the finer ISAs (VNNI, and what Ice Lake added) where the processor has them. The set
 * avxvnni is for processors without AVX-512; those with AVX-512 VNNI have it too, in their own form
 * of the same instructions. */
#ifndef FOVEA_KERNELS_CPU_H
#define FOVEA_KERNELS_CPU_H

#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fv_isa {
    FV_ISA_SSE4 = 1u << 0,       /* SSE4.2 and POPCNT */
    FV_ISA_AVX2 = 1u << 1,       /* AVX2, FMA, BMI1, BMI2 */
    FV_ISA_AVX512 = 1u << 2,     /* AVX-512 F, BW, DQ, VL, CD */
    FV_ISA_AVX512VNNI = 1u << 3, /* and VNNI */
    FV_ISA_AVX512ICL = 1u << 4,  /* and VNNI, VBMI, VBMI2, BITALG, VPOPCNTDQ */
    FV_ISA_NEON = 1u << 5,
    FV_ISA_DOTPROD = 1u << 6,
    FV_ISA_I8MM = 1u << 7,
    FV_ISA_AVXVNNI = 1u << 8,  /* AVX2 and VNNI on 256 bits (VEX) */
    FV_ISA_EVEXVNNI = 1u << 9, /* the same in the form of AVX-512 VNNI and VL */
};

enum fv_cpu_set {
    FV_CPU_C = 0,
    FV_CPU_SSE4,
    FV_CPU_AVX2,
    FV_CPU_AVXVNNI,
    FV_CPU_AVX512,
    FV_CPU_NEON,
    FV_CPU_DOTPROD,
    FV_CPU_I8MM,
    FV_CPU_SET_COUNT
};

/* Name as in FOVEA_CPU. Any thread. */
const char *fv_cpu_set_name(enum fv_cpu_set set);

/* ISAs (bits of enum fv_isa) that this processor and its operating system offer. Init-only. */
uint32_t fv_cpu_detect(void);

/* ISAs that a set allows, whether the processor has them or not. Any thread. */
uint32_t fv_cpu_allowed(enum fv_cpu_set set);

/* The best set that these ISAs make up. Any thread. */
enum fv_cpu_set fv_cpu_best(uint32_t isas);

/* Read a set's name; NULL or "" stands for the best. Init-only.
 * FOVEA_ERROR_ARGUMENT: the name is unknown or the processor lacks the set; `error` says so; `set`
 * is untouched. */
enum fovea_status fv_cpu_parse(const char *name, enum fv_cpu_set *set, struct fovea_error *error);

/* fv_cpu_parse of the environment variable FOVEA_CPU. Init-only. */
enum fovea_status fv_cpu_from_environment(enum fv_cpu_set *set, struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif
