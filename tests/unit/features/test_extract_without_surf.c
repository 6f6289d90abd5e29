/* Local features of a build with SURF=no, as packages are made: every test of the others holds, and
 * SURF is refused by name. The object with the method's table is compiled here once more without
 * it.
 */
#define FV_WITHOUT_SURF
#include "../../../src/features/extract.c"

#include "test_extract.c"
