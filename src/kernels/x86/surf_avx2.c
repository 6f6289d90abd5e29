#define FV_NAME(kernel) fv_k_##kernel##__avx2
#include "kernels/surf_loops.h"
