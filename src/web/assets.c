#include "web/assets.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <zlib.h>

/* The Makefile compresses the files of src/web/page and the definitions of the messages, and names
 * the folder. */
#ifndef FV_WEB_PAGE
#define FV_WEB_PAGE "build/page"
#endif
#define ASSET(name, file)                                                                          \
    __asm__(".pushsection .rodata\n" #name ":\n.incbin \"" FV_WEB_PAGE "/" file ".gz\"\n" #name    \
            "_end:\n.popsection\n");                                                               \
    extern const uint8_t name[] __attribute__((visibility("hidden")));                             \
    extern const uint8_t name##_end[] __attribute__((visibility("hidden")));

#define JAVASCRIPT "text/javascript; charset=utf-8"
#define HTML "text/html; charset=utf-8"
#define CSS "text/css; charset=utf-8"
#define SVG "image/svg+xml"
#define TEXT "text/plain; charset=utf-8"

/* Those of libraries are in the folders by which they find each other. */
#define EVERY_ASSET(ROW)                                                                           \
    ROW(index, "/", "index.html", HTML, false)                                                     \
    ROW(style, "/style.css", "style.css", CSS, true)                                               \
    ROW(icon, "/icon.svg", "icon.svg", SVG, true)                                                  \
    ROW(login, "/login", "login.html", HTML, true)                                                 \
    ROW(readable, "/readable.js", "readable.js", JAVASCRIPT, true)                                 \
    ROW(app, "/app.js", "app.js", JAVASCRIPT, false)                                               \
    ROW(link, "/link.js", "link.js", JAVASCRIPT, false)                                            \
    ROW(lcm, "/lcm.js", "lcm.js", JAVASCRIPT, false)                                               \
    ROW(live, "/live.js", "live.js", JAVASCRIPT, false)                                            \
    ROW(scene, "/scene.js", "scene.js", JAVASCRIPT, false)                                         \
    ROW(space, "/space.js", "space.js", JAVASCRIPT, false)                                         \
    ROW(lines, "/lines.js", "lines.js", JAVASCRIPT, false)                                         \
    ROW(layers, "/layers.js", "layers.js", JAVASCRIPT, false)                                      \
    ROW(view, "/view.js", "view.js", JAVASCRIPT, false)                                            \
    ROW(plots, "/plots.js", "plots.js", JAVASCRIPT, false)                                         \
    ROW(charts, "/charts.js", "charts.js", JAVASCRIPT, false)                                      \
    ROW(panels, "/panels.js", "panels.js", JAVASCRIPT, false)                                      \
    ROW(parameters, "/parameters.js", "parameters.js", JAVASCRIPT, false)                          \
    ROW(requests, "/requests.js", "requests.js", JAVASCRIPT, false)                                \
    ROW(playback, "/playback.js", "playback.js", JAVASCRIPT, false)                                \
    ROW(settings, "/settings.js", "settings.js", JAVASCRIPT, false)                                \
    ROW(maps, "/maps.js", "maps.js", JAVASCRIPT, false)                                            \
    ROW(calibration, "/calibration.js", "calibration.js", JAVASCRIPT, false)                       \
    ROW(recordings, "/recordings.js", "recordings.js", JAVASCRIPT, false)                          \
    ROW(robots, "/robots.js", "robots.js", JAVASCRIPT, false)                                      \
    ROW(calibrate, "/calibrate", "calibrate.html", HTML, false)                                    \
    ROW(calibrate_js, "/calibrate.js", "calibrate.js", JAVASCRIPT, false)                          \
    ROW(types, "/types", "types.txt", TEXT, false)                                                 \
    ROW(chart, "/chart.js", "library/chart.js/chart.min.js", JAVASCRIPT, false)                    \
    ROW(three, "/three/build/three.module.js", "library/three/three.module.js", JAVASCRIPT, false) \
    ROW(orbit_controls, "/three/examples/jsm/controls/OrbitControls.js",                           \
        "library/three/examples/jsm/controls/OrbitControls.js", JAVASCRIPT, false)                 \
    ROW(line_material, "/three/examples/jsm/lines/LineMaterial.js",                                \
        "library/three/examples/jsm/lines/LineMaterial.js", JAVASCRIPT, false)                     \
    ROW(line_segments, "/three/examples/jsm/lines/LineSegments2.js",                               \
        "library/three/examples/jsm/lines/LineSegments2.js", JAVASCRIPT, false)                    \
    ROW(line_geometry, "/three/examples/jsm/lines/LineSegmentsGeometry.js",                        \
        "library/three/examples/jsm/lines/LineSegmentsGeometry.js", JAVASCRIPT, false)

#define DATA(name, path, file, type, open) ASSET(fv_web_page_##name, file)
EVERY_ASSET(DATA)

#define ENTRY(name, path, file, type, open)                                                        \
    {path, type, open, fv_web_page_##name, fv_web_page_##name##_end},
static const struct fv_web_asset assets[] = {EVERY_ASSET(ENTRY)};

const struct fv_web_asset *fv_web_asset_find(const char *path)
{
    for (size_t i = 0; i < sizeof assets / sizeof assets[0]; i++)
        if (strcmp(path, assets[i].path) == 0) return &assets[i];
    return NULL;
}

void fv_web_asset_tag(const struct fv_web_asset *asset, char tag[FV_WEB_TAG_BYTES])
{
    const uint8_t *tail = asset->gzip_end - 8; /* RFC 1952: CRC-32, and the length */
    size_t at = (size_t)snprintf(tag, FV_WEB_TAG_BYTES, "W/\"");
    for (int i = 0; i < 8; i++)
        at += (size_t)snprintf(tag + at, FV_WEB_TAG_BYTES - at, "%02x", tail[i]);
    snprintf(tag + at, FV_WEB_TAG_BYTES - at, "\"");
}

uint8_t *fv_web_asset_inflate(const struct fv_web_asset *asset, size_t *bytes)
{
    const size_t packed = (size_t)(asset->gzip_end - asset->gzip);
    uint8_t *text = NULL;
    z_stream stream = {.next_in = (z_const Bytef *)(uintptr_t)asset->gzip,
                       .avail_in = (uInt)packed};
    if (packed < 4) return NULL;
    const uint8_t *tail = asset->gzip_end - 4; /* RFC 1952: the length, least byte first */
    *bytes = tail[0] | (size_t)tail[1] << 8 | (size_t)tail[2] << 16 | (size_t)tail[3] << 24;
    if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK) return NULL;
    text = malloc(*bytes + 1);
    stream.next_out = text;
    stream.avail_out = (uInt)*bytes;
    if (text != NULL && inflate(&stream, Z_FINISH) != Z_STREAM_END) {
        free(text);
        text = NULL;
    }
    inflateEnd(&stream);
    return text;
}
