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

int usage()
{
    printf("usage: fovea-calibrate COMMAND [OPTION]...\n\n");
    for (const Command &command : commands)
        printf("  %-10s %s\n", command.name, command.help);
    printf("  %-10s %s\n\n  --version  print the version\n  --man      print the manual page\n",
           "help", "this list; 'fovea-calibrate COMMAND --help' lists its options");
    return FV_EXIT_OK;
}

bool is_help(const char *word)
{
    return std::strcmp(word, "help") == 0 || std::strcmp(word, "--help") == 0 ||
           std::strcmp(word, "-h") == 0;
}

int dispatch(int argc, char **argv)
{
    if (argc < 2)
        return fv_say_wrong("fovea-calibrate: no command given ('fovea-calibrate help' lists all)");
    if (std::strcmp(argv[1], "--version") == 0) {
        printf("fovea-calibrate %s\n", FOVEA_VERSION);
        return FV_EXIT_OK;
    }
    if (std::strcmp(argv[1], "--man") == 0) {
        man_program();
        return FV_EXIT_OK;
    }
    const bool help = is_help(argv[1]);
    if (help && (argc == 2 || is_help(argv[2]))) return usage();
    const char *name = argv[help ? 2 : 1];
    char listing[] = "--help", *options[] = {argv[help ? 2 : 1], listing, nullptr};
    for (const Command &command : commands)
        if (std::strcmp(name, command.name) == 0)
            return help ? command.run(2, options) : command.run(argc - 1, argv + 1);
    return fv_say_wrong("fovea-calibrate: unknown command '%s' ('fovea-calibrate help' lists all)",
                        name);
}

} // namespace

} // namespace calibrate

int main(int argc, char **argv)
{
    const int status = calibrate::dispatch(argc, argv);
    const int written = fv_say_unwritten();
    return status == FV_EXIT_OK ? written : status;
}
