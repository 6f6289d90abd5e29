/* What a command writes must not be what it reads, by whatever path: links, hard links, folders.
 * And what an earlier command wrote stays until it is known that all can be written. Init-only. */
#ifndef FOVEA_SUPPORT_FILES_H
#define FOVEA_SUPPORT_FILES_H

#include <stdbool.h>
#include <sys/types.h>

#include "fovea/status.h"

struct fv_file {
    const char *option; /* as the user named it, for example "--record" */
    const char *path; /* NULL or "": none; one that ends in '/': a folder where files come and go */
};

/* FOVEA_ERROR_INPUT when one of `written`, or its temporary name (support/output.h), is the same
 * file as another of them or as one of `read`, by device and inode; files that are not there yet
 * are the same when name and folder are. Both lists end with a row whose option is NULL. Devices
 * and pipes may be shared. */
enum fovea_status fv_files_apart(const struct fv_file *written, const struct fv_file *read,
                                 struct fovea_error *error);

/* Whether both paths are there and lead to one file; without `follow`, whether they are names of
 * one file themselves, for a symbolic link is then a file of its own. */
bool fv_files_same(const char *one, const char *other, bool follow);

/* As fv_files_apart for what a source reads, one file or folder at a time: of a folder, every file
 * in it counts. One stat per file, so that a million of frames may be looked at. */
enum { FV_FILES_WATCHED_MAX = 40 };

struct fv_files_identity {
    bool there;
    dev_t device;
    ino_t inode;
};

struct fv_files_watch {
    const struct fv_file *written; /* ended by a row without option, at most FV_FILES_WATCHED_MAX */
    const char *option;            /* names what reads, in the error */
    struct fovea_error *error;
    enum fovea_status status; /* FOVEA_OK until one is met */
    /* Of each written file: itself, its temporary name, its folder. */
    struct fv_files_identity file[FV_FILES_WATCHED_MAX], part[FV_FILES_WATCHED_MAX],
        folder[FV_FILES_WATCHED_MAX];
};

void fv_files_watch(struct fv_files_watch *watch, const struct fv_file *written, const char *option,
                    struct fovea_error *error);
/* Its type fits fovea_source_ops.reads; `context` is a struct fv_files_watch. */
void fv_files_visit(void *context, const char *path);

/* FOVEA_ERROR_INPUT when one of `written` cannot be written or is being written by another program;
 * `blame` is then its option. Nothing is changed: no file is left, none is cut. */
enum fovea_status fv_files_writable(const struct fv_file *written, const char **blame,
                                    struct fovea_error *error);

#endif
