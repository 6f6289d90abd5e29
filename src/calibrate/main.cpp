/* fovea-calibrate: a camera model from pictures of a board. */
#include <cstdio>
#include <cstring>

#include "calibrate/command.h"
#include "fovea/fovea.h"
extern "C" {
#include "support/say.h"
}

namespace calibrate
{
namespace
{

struct Command {
    const char *name, *help;
    int (*run)(int argc, char **argv);
};

const Command commands[] = {
    {"camera", "calibrate a camera from pictures of a chessboard", command_camera},
    {"target", "write a chessboard to print, as PDF at exact size", command_target},
    {"convert", "write a camera file in another format", command_convert},
};

int usage()
{
    printf("usage: fovea-calibrate COMMAND [OPTION]...\n\n");
    for (const Command &command : commands)
        printf("  %-10s %s\n", command.name, command.help);
    printf("  %-10s %s\n\n  --version  print the version\n", "help",
           "this list; 'fovea-calibrate COMMAND --help' lists its options");
    return FV_EXIT_OK;
}

int dispatch(int argc, char **argv)
{
    if (argc < 2)
        return fv_say_wrong("fovea-calibrate: no command given ('fovea-calibrate help' lists all)");
    if (std::strcmp(argv[1], "--version") == 0) {
        printf("fovea-calibrate %s\n", FOVEA_VERSION);
        return FV_EXIT_OK;
    }
    for (const char *help : {"help", "--help", "-h"})
        if (std::strcmp(argv[1], help) == 0) return usage();
    for (const Command &command : commands)
        if (std::strcmp(argv[1], command.name) == 0) return command.run(argc - 1, argv + 1);
    return fv_say_wrong("fovea-calibrate: unknown command '%s' ('fovea-calibrate help' lists all)",
                        argv[1]);
}

} // namespace

} // namespace calibrate

int main(int argc, char **argv)
{
    const int status = calibrate::dispatch(argc, argv);
    const int written = fv_say_unwritten();
    return status == FV_EXIT_OK ? written : status;
}
