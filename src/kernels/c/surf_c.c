#define FV_NAME(kernel) fv_k_##kernel##__c
#include "kernels/surf_loops.h"
