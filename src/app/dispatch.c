/* Finding the command that was asked for. */
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "app/command.h"
#include "app/config/options.h"
#include "app/man.h"
#include "support/man.h"
#include "support/say.h"
#include "fovea/fovea.h"
#include "support/text.h"

static void help_print(void)
{
    printf("usage: fovea COMMAND [OPTION]...\n\n");
    for (const struct fv_command *command = fv_commands; command->name != NULL; command++)
        printf("  %-10s %s\n", command->name, command->help);
    printf("  %-10s %s\n", "help",
           "this list; 'fovea help COMMAND' and 'fovea COMMAND --help' list its options");
    printf("\n  --version  print the version\n  --man      print the manual page\n");
}

static int unknown(const char *name)
{
    enum { NAMES_MAX = 64 };
    const char *names[NAMES_MAX];
    size_t count = 0;
    for (; fv_commands[count].name != NULL && count < NAMES_MAX; count++)
        names[count] = fv_commands[count].name;
    const char *nearest = fv_text_nearest(name, names, count);
    return fv_say_wrong("fovea: unknown %s '%s'%s%s%s ('fovea help' lists all)",
                        name[0] == '-' ? "option" : "command", name,
                        nearest ? ", nearest is '" : "", nearest ? nearest : "",
                        nearest ? "'" : "");
}

static const struct fv_command *command_find(const char *name)
{
    for (const struct fv_command *command = fv_commands; command->name != NULL; command++)
        if (strcmp(command->name, name) == 0) return command;
    return NULL;
}

static bool is_help(const char *word)
{
    return strcmp(word, "help") == 0 || strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0;
}

static int dispatch(int argc, char **argv)
{
    if (argc < 2) return fv_say_wrong("fovea: no command given ('fovea help' lists all)");
    if (strcmp(argv[1], "--version") == 0) {
        printf("fovea %s\n", FOVEA_VERSION);
        return FV_EXIT_OK;
    }
    if (strcmp(argv[1], "--man") == 0) {
        fv_man_program();
        return FV_EXIT_OK;
    }
    const bool help = is_help(argv[1]);
    if (help && (argc == 2 || is_help(argv[2]))) {
        help_print();
        return FV_EXIT_OK;
    }
    const struct fv_command *command = command_find(argv[help ? 2 : 1]);
    if (command == NULL) return unknown(argv[help ? 2 : 1]);
    if (help) {
        char *arguments[] = {argv[2], (char[]){"--help"}, NULL};
        return command->run(2, arguments);
    }
    fv_options_describe(
        &(struct fv_options_page){.help = command->help, .description = command->description});
    const int status = command->run(argc - 1, argv + 1);
    if (fv_options_man_printed()) {
        fv_man_section("EXAMPLES");
        fv_man_example(command->examples);
        fv_man_see_also(command->name);
    }
    return status;
}

/* Where the caller closed a standard stream, the next file opened would get its number, and what is
 * printed would go into a recording. */
static bool open_standard_streams(void)
{
    for (int stream = 0; stream <= 2; stream++)
        if (fcntl(stream, F_GETFD) < 0 && open("/dev/null", O_RDWR) != stream) return false;
    return true;
}

int fv_dispatch(int argc, char **argv)
{
    if (!open_standard_streams()) return FV_EXIT_FAILED;
    signal(SIGXFSZ, SIG_IGN); /* a limit on file sizes is an error of that file, not the end */
    const int status = dispatch(argc, argv);
    return status == FV_EXIT_OK ? (int)fv_say_unwritten() : status;
}
