/* Commands of fovea-calibrate, and their options. */
#ifndef FOVEA_CALIBRATE_COMMAND_H
#define FOVEA_CALIBRATE_COMMAND_H

#include <string>
#include <vector>

#include "calibrate/calibrate.h"

namespace calibrate
{

struct Command {
    const char *name, *help; /* one line, no full stop */
    int (*run)(int argc, char **argv);
    const char *description; /* sentences for the manual page */
    const char *examples;    /* command lines, one per line */
};

extern const std::vector<Command> commands;

/* The manual page of the program itself. */
void man_program();

struct Option {
    const char *name;    /* without the dashes */
    const char *value;   /* what the help calls its value */
    std::string *target; /* "" when it is not given; nullptr: it may be given several times */
    const char *help;
    std::vector<std::string> *all = nullptr; /* then each of its values */
};

/* argv[0] is the command's name. False: leave with `*status`; help, the manual page or one line was
 * printed. */
bool options_parse(int argc, char **argv, const std::vector<Option> &options, const char *operands,
                   size_t operand_count, std::vector<std::string> &found, int *status);

/* FV_EXIT_OK and the board, or a line is printed: one of both options is missing or wrong. */
int source_check(const char *command, const std::string &source, const std::string &target,
                 Board &board);

/* FV_EXIT_OK and the value of --views, `usual` where it is empty, or a line is printed: it is not
 * from `least` to 500. */
int views_check(const std::string &views, int usual, int least, int64_t &views_max);

/* A file or folder that a command reads or writes; an empty path is none. */
struct NamedFile {
    const char *option;
    std::string path;
    bool source; /* a folder of pictures or the URI of a source */
};

/* FV_EXIT_OK, or a line is printed: one of `written` cannot be written, or is one of `read`. */
int files_check(const std::vector<NamedFile> &written, const std::vector<NamedFile> &read);

/* The camera of a file, prepared and of that size. FV_EXIT_OK, or a line is printed. */
int read_camera(const std::string &file, int width, int height, fovea_camera &camera);

/* Pictures of a camera that is known: collect, and its file. FV_EXIT_OK, or a line is printed. */
struct Collection;
int collect_known(const std::string &source, const std::string &file, const Board &board,
                  int views_max, Collection &collection, fovea_camera &camera);

/* Models of lenses that --model names; false: none. */
bool models_of(const std::string &text, std::vector<Model> &models);

std::string now_text(); /* ISO 8601, UTC */

int command_camera(int argc, char **argv);
int command_check(int argc, char **argv);    /* an old camera file against new pictures */
int command_rig(int argc, char **argv);      /* several cameras to each other */
int command_floor(int argc, char **argv);    /* height and tilt over the floor */
int command_hand_eye(int argc, char **argv); /* a camera on a body that moves */
int command_imu(int argc, char **argv);      /* noise of an inertial sensor */
int command_target(int argc, char **argv);   /* a board to print */
int command_convert(int argc, char **argv);  /* a camera file of another format */

} // namespace calibrate
#endif
