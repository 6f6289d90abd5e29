#include "web/pages.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/thread.h"
#include "support/say.h"
#include "web/server.h"

struct fv_web_pages {
    struct fv_web_server *server;
    struct fv_web_tokens tokens;
    struct fv_web_pages_setup setup;
    const char *names[1];
    pthread_t thread;
};

static void *serve(void *context)
{
    struct fv_web_pages *pages = context;
    (void)fv_web_server_run(pages->server);
    return NULL;
}

static enum fovea_status open_server(struct fv_web_pages *pages, struct fovea_error *error)
{
    const struct fv_web_pages_setup *setup = &pages->setup;
    bool made = false;
    enum fovea_status status = fv_web_address_check(setup->address, setup->token != NULL, error);
    if (status == FOVEA_OK && setup->token != NULL)
        status = fv_web_tokens_read(setup->token, &pages->tokens, &made, error);
    const struct fv_web_certificate certificate = {.file = setup->certificate,
                                                   .key_file = setup->certificate_key};
    if (status == FOVEA_OK && certificate.file != NULL)
        status = fv_web_certificate_check(&certificate, error);
    if (status != FOVEA_OK) return status;
    if (made) fv_say_note("made %s: either of its tokens opens the page", setup->token);
    pages->names[0] = setup->name;
    const struct fv_web_setup whole = {.address = setup->address,
                                       .port = setup->port,
                                       .names = pages->names,
                                       .name_count = setup->name != NULL,
                                       .tokens = setup->token != NULL ? &pages->tokens : NULL,
                                       .certificate = certificate,
                                       .pages = &pages->setup};
    status = fv_web_server_open(&whole, &pages->server, error);
    if (status != FOVEA_OK) return status;
    const bool all = strcmp(setup->address, "0.0.0.0") == 0;
    fv_say_note("page: http%s://%s:%u/", certificate.file != NULL ? "s" : "",
                all && setup->name != NULL ? setup->name
                : all                      ? "127.0.0.1"
                                           : setup->address,
                (unsigned)fv_web_server_port(pages->server));
    fv_web_server_warn(pages->server, "");
    return FOVEA_OK;
}

enum fovea_status fv_web_pages_open(const struct fv_web_pages_setup *setup,
                                    struct fv_web_pages **pages, struct fovea_error *error)
{
    struct fv_web_pages *made = calloc(1, sizeof *made);
    *pages = NULL;
    if (made == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the page");
    made->setup = *setup;
    enum fovea_status status = open_server(made, error);
    if (status == FOVEA_OK && fv_thread_start(&made->thread, serve, made) != 0) {
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "the page found no thread");
        fv_web_server_close(made->server);
    }
    if (status != FOVEA_OK) {
        free(made);
        return status;
    }
    *pages = made;
    return FOVEA_OK;
}

void fv_web_pages_close(struct fv_web_pages *pages)
{
    if (pages == NULL) return;
    fv_web_server_stop(pages->server);
    pthread_join(pages->thread, NULL);
    fv_web_server_close(pages->server);
    free(pages);
}
