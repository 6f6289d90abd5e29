/* What the commands share that find where a known camera is on its body: floor and hand-eye. */
#ifndef FOVEA_CALIBRATE_KNOWN_COMMAND_H
#define FOVEA_CALIBRATE_KNOWN_COMMAND_H

#include "calibrate/command.h"
#include "calibrate/pictures.h"
#include "calibrate/verdict.h"

namespace calibrate
{

struct KnownGiven {
    std::string source, target, camera, out, json, report, views; /* as the options state them */
};

/* Their options, with `own` of the command before the outputs. */
std::vector<Option> known_options(KnownGiven &given, const std::vector<Option> &own,
                                  const char *out_help, const char *views_help);
/* FV_EXIT_OK and the board, or a line is printed: source, board or camera is missing or wrong. */
int known_check(const char *command, const KnownGiven &given, Board &board);
/* files_check for these; `more` are read, too. */
int known_files(const KnownGiven &given, const std::vector<NamedFile> &more = {});

struct KnownReport {
    Board board;
    std::vector<View> views;
    Verdict verdict;
    std::string camera, source, date; /* files as given; ISO 8601, UTC */
};

void known_begin(const KnownGiven &given, const Collection &collection, KnownReport &report);

std::string known_json(const KnownReport &report); /* its first members */
/* The head of the HTML page. `keys` is what the command writes, `origin` where its other input is
 * from, as " Poses: FILE.", or empty. */
std::string known_header(const KnownReport &report, const char *title, const char *keys,
                         const std::string &origin = "");
/* The key T_body_cam of Fovea's configuration, from three rows of [R t]. */
std::string T_body_cam_key(const std::array<double, 12> &T);

/* Write what is asked for; the command's exit status. */
int known_write(const KnownGiven &given, const KnownReport &report, const std::string &json,
                const std::string &html, const std::string &configuration);

} // namespace calibrate
#endif
