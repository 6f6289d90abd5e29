/* The files of the page, compressed inside the program: it needs no folder and no network. */
#ifndef FOVEA_WEB_ASSETS_H
#define FOVEA_WEB_ASSETS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { FV_WEB_TAG_BYTES = 24 };

struct fv_web_asset {
    const char *path, *type;
    bool open; /* of the login page: seen without a token */
    const uint8_t *gzip, *gzip_end;
};

/* NULL: there is none. */
const struct fv_web_asset *fv_web_asset_find(const char *path);

/* An entity tag of HTTP, which identifies its content; weak, since it stands for the asset
 * compressed and not. */
void fv_web_asset_tag(const struct fv_web_asset *asset, char tag[FV_WEB_TAG_BYTES]);

/* The asset without compression, in memory of malloc. NULL: no memory. */
uint8_t *fv_web_asset_inflate(const struct fv_web_asset *asset, size_t *bytes);

#endif
