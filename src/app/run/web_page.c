#include "app/run/web_page.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "support/program.h"
#include "support/say.h"
#include "support/text.h"

static void socket_choose(struct fv_settings *settings)
{
    const char *folder = getenv("XDG_RUNTIME_DIR");
    if (settings->web_socket[0] != '\0') return;
    if (folder == NULL || access(folder, W_OK) != 0 || strlen(folder) > 60) folder = "/tmp";
    snprintf(settings->web_socket, sizeof settings->web_socket, "%s/fovea-%d.sock", folder,
             (int)getpid());
}

enum fovea_status fv_web_page_start(const char *port, struct fv_settings *settings, pid_t *child,
                                    struct fovea_error *error)
{
    char program[4096], rate[16], process[16];
    int64_t number = 0;
    *child = 0;
    if (port == NULL) return FOVEA_OK;
    if (port[0] != '\0' && (!fv_text_integer(port, &number) || number < 0 || number > UINT16_MAX))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "fovea run: --web: found '%.40s', expected a port from 0 to 65535",
                               port);
    if (!fv_program_beside("fovea-web", program, sizeof program))
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "fovea run: --web: found no program fovea-web beside this one, "
            "expected it there (it is built where libwebsockets and jansson are: "
            "tools/install.sh web)");
    socket_choose(settings);
    snprintf(process, sizeof process, "%d", (int)getpid());
    snprintf(rate, sizeof rate, "%u",
             settings->web_picture_rate > 0 && settings->web_picture_rate < 60
                 ? settings->web_picture_rate
                 : 15);
    const char *words[24] = {program,  "--with-parent",      process,
                             "--feed", settings->web_socket, "--rate",
                             rate,     "--lcm-url",          settings->lcm_url};
    int count = 9;
    if (port[0] != '\0') {
        words[count++] = "--port";
        words[count++] = port;
    }
    if (settings->record_folder[0] != '\0') {
        words[count++] = "--recordings";
        words[count++] = settings->record_folder;
    }
    if (settings->web_origins[0] != '\0') {
        words[count++] = "--origins";
        words[count++] = settings->web_origins;
    }
    if (settings->command_key[0] != '\0') {
        words[count++] = "--command-key";
        words[count++] = settings->command_key;
    }
    const int failed = fv_program_start(program, words, child);
    if (failed == 0) return FOVEA_OK;
    *child = 0;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "fovea run: --web: %.300s: %s", program,
                           strerror(failed));
}

void fv_web_page_tend(pid_t *child)
{
    int status;
    if (*child <= 0 || waitpid(*child, &status, WNOHANG) != *child) return;
    *child = 0;
    if (WIFSIGNALED(status))
        fv_say("fovea run: the page has ended, by signal %d; the run goes on", WTERMSIG(status));
    else
        fv_say("fovea run: the page has ended, with exit status %d; the run goes on",
               WEXITSTATUS(status));
}

void fv_web_page_end(pid_t child)
{
    if (child <= 0) return;
    kill(child, SIGTERM);
    while (waitpid(child, NULL, 0) < 0 && errno == EINTR)
        continue;
}
