#define FV_NAME(kernel) fv_k_##kernel##__avx2
#include "kernels/response_loops.h"
