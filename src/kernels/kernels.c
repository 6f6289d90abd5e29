#include "kernels/kernels.h"

void fv_kernels_init(struct fv_kernels *kernels, enum fv_cpu_set cap)
{
    const uint32_t isas = fv_cpu_detect() & fv_cpu_allowed(cap);
    *kernels = (struct fv_kernels){.set = fv_cpu_best(isas), .isas = isas};

#define USE(name, isa, bit)                                                                        \
    if (isas & (bit)) kernels->name = fv_k_##name##__##isa;
#define FV_KERNEL(name, ...)                                                                       \
    kernels->name = fv_k_##name##__c;                                                              \
    FV_VARIANTS(USE, name, __VA_ARGS__)
#include "kernels/kernels.def"
#undef FV_KERNEL
#undef USE
}
