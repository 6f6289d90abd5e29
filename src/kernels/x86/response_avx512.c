#define FV_NAME(kernel) fv_k_##kernel##__avx512
#include "kernels/response_loops.h"
