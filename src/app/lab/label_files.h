/* Which of the pictures that a command is given are judged by labels, and by which label picture of
 * a folder DIR: of NAME.EXT, in any folder, DIR/NAME.mask.png, as `fovea export --masks` writes it,
 * or, where DIR holds no *.mask.png, DIR/NAME.png.
 *
 * Left out are label pictures (NAME.mask.png), and pictures of a rig's further cameras
 * (NAME.camN.EXT) without labels: exports have none of them. The heap is used. */
#ifndef FOVEA_APP_LAB_LABEL_FILES_H
#define FOVEA_APP_LAB_LABEL_FILES_H

#include "fovea/status.h"

struct fv_label_files {
    char **pictures, **labels; /* `count` of each, in the order of the pictures given */
    int count;
    int masks, others; /* left out: label pictures, pictures of further cameras */
};

/* Fill `files`, which is all zero. FOVEA_ERROR_INPUT, with an error that names the pictures: none
 * is left; one would be judged by itself; two by one label picture; or one by DIR/NAME.mask.png
 * though another NAME.mask.png lies beside it, as in a folder of another export. Whether label
 * pictures are there is only asked of those of further cameras. */
enum fovea_status fv_label_files_find(struct fv_label_files *files, const char *folder,
                                      char *const *pictures, int count, struct fovea_error *error);
void fv_label_files_free(struct fv_label_files *files);

#endif
