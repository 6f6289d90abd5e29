#include "app/man.h"

#include <stdio.h>
#include <string.h>

#include "app/command.h"
#include "support/man.h"

void fv_man_see_also(const char *command)
{
    if (command != NULL) fv_man_reference("fovea", NULL, true);
    for (const struct fv_command *other = fv_commands; other->name != NULL; other++)
        if (command == NULL || strcmp(other->name, command) != 0)
            fv_man_reference("fovea", other->name, command == NULL && other == fv_commands);
    fv_man_reference("fovea-calibrate", NULL, false);
    putchar('\n');
}

/* ---- the program ----------------------------------------------------------------------------- */

void fv_man_program(void)
{
    fv_man_begin("fovea", NULL, "fixed-memory vision runtime for robots");
    fv_man_synopsis("fovea", NULL, "COMMAND [OPTION]...\n\nfovea --version\n\nfovea --man");
    fv_man_section("DESCRIPTION");
    fv_man_text(
        "Takes the frames of a camera and sends poses, maps, detections, objects and features as "
        "LCM messages, every frame, from one real-time loop in one block of memory. A run can be "
        "recorded and replayed bit for bit.");
    fv_man_section("COMMANDS");
    for (const struct fv_command *command = fv_commands; command->name != NULL; command++)
        fv_man_item(command->name, NULL, command->help);
    fv_man_item("help", NULL, "list the commands, or the options of the command named after it");
    fv_man_section("OPTIONS");
    fv_man_item("--version", NULL, "print the version");
    fv_man_item("--help", NULL, "list the commands; of a command: list its options");
    fv_man_item("--man", NULL, "print this page; of a command: print its page");
    fv_man_section("EXIT STATUS");
    fv_man_item("0", NULL, "success");
    fv_man_item("1", NULL, "failed while running: the machine, a full disk, a replay that differs");
    fv_man_item("2", NULL,
                "wrong input: arguments, configuration, calibration, recording, model or map. One "
                "line names the file, the key or byte, what was found and what was expected");
    fv_man_section("ENVIRONMENT");
    fv_man_item("FOVEA_CPU", NULL,
                "highest kernel set that is used: c, sse4, avx2, avxvnni, avx512, neon, dotprod or "
                "i8mm "
                "(default: the best that the processor has; results are the same)");
    fv_man_item("FOVEA_PLUGINS", NULL,
                "folder of fovea-video.so and fovea-libcamera, instead of the installed one");
    fv_man_item("FOVEA_SYS_ROOT", NULL,
                "folder in which /sys is looked for temperatures and throttling, for tests");
    fv_man_item("NO_COLOR", NULL, "when it is set and not empty, the terminal shows no colours");
    fv_man_see_also(NULL);
}
