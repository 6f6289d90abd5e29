/* One entry for each variant of each row of kernels.def. A row without its check_<name> and
 * bench_<name> does not link. */
#include "kernels/check.h"

#define FV_KERNEL(name, ...)                                                                       \
    static void bench_##name##__c(struct check *check)                                             \
    {                                                                                              \
        bench_##name(check, fv_k_##name##__c);                                                     \
    }                                                                                              \
    static void check_##name##__c(struct check *check)                                             \
    {                                                                                              \
        check_##name(check, fv_k_##name##__c, fv_k_##name##__c);                                   \
    }                                                                                              \
    FV_VARIANTS(WRAP, name, __VA_ARGS__)
#define WRAP(name, isa, bit)                                                                       \
    static void check_##name##__##isa(struct check *check)                                         \
    {                                                                                              \
        check_##name(check, fv_k_##name##__c, fv_k_##name##__##isa);                               \
    }                                                                                              \
    static void bench_##name##__##isa(struct check *check)                                         \
    {                                                                                              \
        bench_##name(check, fv_k_##name##__##isa);                                                 \
    }
#include "kernels/kernels.def"
#undef FV_KERNEL

#define ENTRY(name, isa, bit) {#name, #isa, bit, check_##name##__##isa, bench_##name##__##isa},
#define FV_KERNEL(name, ...) ENTRY(name, c, 0) FV_VARIANTS(ENTRY, name, __VA_ARGS__)
const struct kernel_variant kernel_variants[] = {
#include "kernels/kernels.def"
};
const int kernel_variant_count = sizeof kernel_variants / sizeof *kernel_variants;
