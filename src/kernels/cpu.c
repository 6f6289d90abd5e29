#include "kernels/cpu.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#include <cpuid.h>
#elif defined(__aarch64__)
#include <sys/auxv.h>
#endif

#if defined(__x86_64__)
/* Whether the operating system saves all the register state in `bits` (XCR0) on a task switch. */
static bool state_saved(uint32_t bits)
{
    uint32_t eax, edx;
    __asm__ volatile("xgetbv" : "=a"(eax), "=d"(edx) : "c"(0));
    return (eax & bits) == bits;
}

uint32_t fv_cpu_detect(void)
{
    enum { YMM_STATE = 0x6, ZMM_STATE = 0xe6 };
    const uint32_t leaf1 = bit_SSE4_2 | bit_SSSE3 | bit_POPCNT,
                   avx = bit_AVX | bit_FMA | bit_OSXSAVE;
    const uint32_t avx2 = bit_AVX2 | bit_BMI | bit_BMI2;
    const uint32_t avx512 = bit_AVX512F | bit_AVX512BW | bit_AVX512DQ | bit_AVX512VL | bit_AVX512CD;
    const uint32_t vnni = bit_AVX512VNNI, avxvnni = 1u << 4; /* of leaf 7, subleaf 1 */
    const uint32_t icl =
        vnni | bit_AVX512VBMI | bit_AVX512VBMI2 | bit_AVX512BITALG | bit_AVX512VPOPCNTDQ;

    uint32_t eax, ebx, ecx, edx, eax7 = 0, ebx7 = 0, ecx7 = 0, eax71 = 0, rest;
    if (!__get_cpuid(1, &eax, &ebx, &ecx, &edx)) return 0;
    __get_cpuid_count(7, 0, &eax7, &ebx7, &ecx7, &edx);
    if (eax7 >= 1) __get_cpuid_count(7, 1, &eax71, &rest, &rest, &rest);

    uint32_t isas = 0;
    if ((ecx & leaf1) != leaf1) return isas;
    isas |= FV_ISA_SSE4;
    if ((ecx & avx) != avx || (ebx7 & avx2) != avx2 || !state_saved(YMM_STATE)) return isas;
    isas |= FV_ISA_AVX2;
    if ((eax71 & avxvnni) != 0) isas |= FV_ISA_AVXVNNI;
    if ((ebx7 & avx512) != avx512 || !state_saved(ZMM_STATE)) return isas;
    isas |= FV_ISA_AVX512;
    if ((ecx7 & vnni) == vnni) isas |= FV_ISA_AVX512VNNI | FV_ISA_EVEXVNNI;
    if ((ecx7 & icl) == icl) isas |= FV_ISA_AVX512ICL;
    return isas;
}
#elif defined(__aarch64__)
uint32_t fv_cpu_detect(void)
{
    /* Bits of the auxiliary vector, as in the kernel's asm/hwcap.h. */
    const unsigned long asimddp = 1ul << 20, i8mm = 1ul << 13;
    uint32_t isas = FV_ISA_NEON;
    if ((getauxval(AT_HWCAP) & asimddp) == 0) return isas;
    isas |= FV_ISA_DOTPROD;
    if ((getauxval(AT_HWCAP2) & i8mm) != 0) isas |= FV_ISA_I8MM;
    return isas;
}
#else
uint32_t fv_cpu_detect(void)
{
    return 0;
}
#endif

/* name, the ISA that the processor must have, or one of these, and every ISA that is allowed */
static const struct set {
    const char *name;
    uint32_t needs_one_of, allowed;
} sets[FV_CPU_SET_COUNT] = {
    [FV_CPU_C] = {"c", 0, 0},
    [FV_CPU_SSE4] = {"sse4", FV_ISA_SSE4, FV_ISA_SSE4},
    [FV_CPU_AVX2] = {"avx2", FV_ISA_AVX2, FV_ISA_SSE4 | FV_ISA_AVX2},
    [FV_CPU_AVXVNNI] = {"avxvnni", FV_ISA_AVXVNNI | FV_ISA_EVEXVNNI,
                        FV_ISA_SSE4 | FV_ISA_AVX2 | FV_ISA_AVXVNNI | FV_ISA_EVEXVNNI},
    [FV_CPU_AVX512] = {"avx512", FV_ISA_AVX512,
                       FV_ISA_SSE4 | FV_ISA_AVX2 | FV_ISA_AVXVNNI | FV_ISA_EVEXVNNI |
                           FV_ISA_AVX512 | FV_ISA_AVX512VNNI | FV_ISA_AVX512ICL},
    [FV_CPU_NEON] = {"neon", FV_ISA_NEON, FV_ISA_NEON},
    [FV_CPU_DOTPROD] = {"dotprod", FV_ISA_DOTPROD, FV_ISA_NEON | FV_ISA_DOTPROD},
    [FV_CPU_I8MM] = {"i8mm", FV_ISA_I8MM, FV_ISA_NEON | FV_ISA_DOTPROD | FV_ISA_I8MM},
};

const char *fv_cpu_set_name(enum fv_cpu_set set)
{
    return (unsigned)set < FV_CPU_SET_COUNT ? sets[set].name : "unknown";
}

uint32_t fv_cpu_allowed(enum fv_cpu_set set)
{
    return (unsigned)set < FV_CPU_SET_COUNT ? sets[set].allowed : 0;
}

static bool has(uint32_t isas, enum fv_cpu_set set)
{
    return sets[set].needs_one_of == 0 || (isas & sets[set].needs_one_of) != 0;
}

enum fv_cpu_set fv_cpu_best(uint32_t isas)
{
    enum fv_cpu_set best = FV_CPU_C;
    for (int set = 0; set < FV_CPU_SET_COUNT; set++)
        if (has(isas, (enum fv_cpu_set)set)) best = (enum fv_cpu_set)set;
    return best;
}

enum fovea_status fv_cpu_parse(const char *name, enum fv_cpu_set *set, struct fovea_error *error)
{
    const uint32_t isas = fv_cpu_detect();
    if (name == NULL || name[0] == '\0') {
        *set = fv_cpu_best(isas);
        return FOVEA_OK;
    }
    char offered[64] = "";
    bool known = false;
    for (int i = 0; i < FV_CPU_SET_COUNT; i++) {
        const bool same = strcmp(name, sets[i].name) == 0;
        known |= same;
        if (!has(isas, (enum fv_cpu_set)i)) continue;
        if (same) {
            *set = (enum fv_cpu_set)i;
            return FOVEA_OK;
        }
        strcat(strcat(offered, i == 0 ? "" : ", "), sets[i].name);
    }
    return fovea_error_set(
        error, FOVEA_ERROR_ARGUMENT, "FOVEA_CPU: found '%.32s', %s; expected one of %s", name,
        known ? "which this processor lacks" : "which is not a kernel set", offered);
}

enum fovea_status fv_cpu_from_environment(enum fv_cpu_set *set, struct fovea_error *error)
{
    return fv_cpu_parse(getenv("FOVEA_CPU"), set, error);
}
