/* fovea: the command-line program, a guest of the library. */
#include "app/command.h"
#include "app/run/realtime.h"

int main(int argc, char **argv)
{
    return fv_realtime_main(fv_dispatch, argc, argv);
}
