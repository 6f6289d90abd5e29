/* What the kernel says about routes and interfaces: news, and answers to the question for a route.
 */
#include "app/network/receiver_groups.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    volatile unsigned kept = fv_groups_route_interface(data, bytes);
    kept += fv_groups_tell_of_deletion(data, bytes);
    (void)kept;
    return 0;
}
