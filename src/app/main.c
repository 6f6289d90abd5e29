/* fovea: the command-line program, a guest of the library. */
#include "app/command.h"

int main(int argc, char **argv)
{
    return fv_dispatch(argc, argv);
}
