#include "web/calibration.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "support/folder.h"
#include "support/program.h"

enum { RESULT_BYTES_MAX = 30000, PATH_BYTES = 4096, WORDS_MAX = 24 };

static const char program_name[] = "fovea-calibrate";

/* Whether it has ended meanwhile is looked at. */
static void look(struct fv_web_calibration *calibration)
{
    int status;
    if (calibration->process <= 0 ||
        waitpid(calibration->process, &status, WNOHANG) != calibration->process)
        return;
    calibration->process = 0;
    calibration->ran = true;
    calibration->status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static bool is_target(const char *target)
{
    static const char plain[] =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_:.,-";
    const size_t length = strlen(target);
    return length > 0 && length < FV_WEB_TARGET_BYTES && strspn(target, plain) == length &&
           target[0] != '-';
}

/* Its options, behind those that are always there. */
static void words_add(const char **words, int *count, const char *option, const char *value)
{
    if (value == NULL) return;
    words[(*count)++] = option;
    words[(*count)++] = value;
}

enum fovea_status fv_web_calibration_start(struct fv_web_calibration *calibration,
                                           const char *socket, const char *target,
                                           struct fovea_error *error)
{
    char program[PATH_BYTES], source[160], out[PATH_BYTES], port[8];
    const time_t now = time(NULL);
    struct tm utc;
    look(calibration);
    if (calibration->process > 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "a calibration goes on: end it first");
    if (!is_target(target))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found no board, expected one as chessboard:9x6:0.025");
    if (!fv_program_beside(program_name, program, sizeof program))
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "found no %s beside fovea-web",
                               program_name);
    gmtime_r(&now, &utc);
    strftime(calibration->file, sizeof calibration->file, "camera-%Y%m%dT%H%M%SZ.yaml", &utc);
    snprintf(source, sizeof source, "feed:%s", socket);
    snprintf(out, sizeof out, "%.3900s/%s", calibration->folder, calibration->file);
    snprintf(port, sizeof port, "%u", (unsigned)calibration->port);
    const char *words[WORDS_MAX] = {program, "camera"};
    int count = 2;
    words_add(words, &count, "--source", source);
    words_add(words, &count, "--target", target);
    words_add(words, &count, "--out", out);
    words_add(words, &count, "--page", port);
    words_add(words, &count, "--address", calibration->address);
    words_add(words, &count, "--host", calibration->name);
    words_add(words, &count, "--token", calibration->token);
    words_add(words, &count, "--certificate", calibration->certificate);
    words_add(words, &count, "--certificate-key", calibration->certificate_key);
    const int failed = fv_program_start(program, words, &calibration->process);
    calibration->ran = false;
    if (failed == 0) return FOVEA_OK;
    calibration->process = 0;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s cannot be started: %s", program_name,
                           strerror(failed));
}

void fv_web_calibration_stop(struct fv_web_calibration *calibration)
{
    look(calibration);
    if (calibration->process > 0) kill(calibration->process, SIGINT);
}

char *fv_web_calibration_result(const struct fv_web_calibration *calibration, size_t *bytes)
{
    struct stat there;
    if (calibration->folder == NULL || calibration->file[0] == '\0') return NULL;
    const int folder = open(calibration->folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) return NULL;
    const int file = fv_folder_open_file(folder, calibration->file, &there);
    close(folder);
    if (file < 0) return NULL;
    *bytes = (size_t)there.st_size;
    char *text = there.st_size <= RESULT_BYTES_MAX ? malloc(*bytes + 1) : NULL;
    if (text != NULL && read(file, text, *bytes) != (ssize_t)*bytes) {
        free(text);
        text = NULL;
    }
    if (text != NULL) text[*bytes] = '\0';
    close(file);
    return text;
}

char *fv_web_calibration_json(struct fv_web_calibration *calibration)
{
    size_t bytes;
    char *json = NULL, *result = NULL;
    if (calibration->folder == NULL) return strdup("null\n");
    look(calibration);
    result = fv_web_calibration_result(calibration, &bytes);
    if (asprintf(&json, "{\"state\":\"%s\",\"port\":%u,\"status\":%d,\"file\":\"%s\"}\n",
                 calibration->process > 0 ? "runs"
                 : calibration->ran       ? "ended"
                                          : "none",
                 (unsigned)calibration->port, calibration->status,
                 result != NULL ? calibration->file : "") < 0)
        json = NULL;
    free(result);
    return json;
}

void fv_web_calibration_end(struct fv_web_calibration *calibration)
{
    if (calibration->process <= 0) return;
    kill(calibration->process, SIGTERM);
    while (waitpid(calibration->process, NULL, 0) < 0 && errno == EINTR)
        continue;
    calibration->process = 0;
}
