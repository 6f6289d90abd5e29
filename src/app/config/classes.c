#include "app/config/classes.h"

#include <string.h>

#include "detect/job.h"
#include "support/text.h"

enum { ENTRY_BYTES = 64 };

/* What moves on its own, or is pushed about, by the names that COCO, Pascal VOC and the shipped
 * network give it. */
static const char *const moves[] = {
    "person",   "bicycle", "car",       "motorcycle",  "motorbike", "airplane",   "aeroplane",
    "bus",      "train",   "truck",     "boat",        "bird",      "cat",        "dog",
    "horse",    "sheep",   "cow",       "elephant",    "bear",      "zebra",      "giraffe",
    "frisbee",  "skis",    "snowboard", "sports ball", "kite",      "skateboard", "surfboard",
    "suitcase", "ball",    "box",       "cone"};

/* The class with this name or number below `count`; -1: none. */
static int32_t class_below(const struct fv_model *model, const char *name, int32_t count)
{
    const int32_t first = model->header->decode.first_label;
    double number;
    for (int32_t i = first; i < (int32_t)model->header->label_count; i++) {
        const char *label = fv_model_label(model, i);
        if (strcmp(label, name) == 0) return i - first < count ? i - first : -1;
    }
    const int32_t labels = (int32_t)model->header->label_count - first;
    if (labels > 0 && labels < count) count = labels;
    if (!fv_text_number(name, &number) || !(number >= 0 && number < count)) return -1;
    return number == (double)(int32_t)number ? (int32_t)number : -1;
}

/* One that the mask of movable classes can hold. */
static int32_t class_of(const struct fv_model *model, const char *name)
{
    return class_below(model, name, FOVEA_OBJECT_CLASSES_MAX);
}

/* The next entry of a list that spaces separate; an underscore stands for a space within a label.
 * False: none is left. */
static bool next(const char **list, char entry[ENTRY_BYTES])
{
    *list += strspn(*list, " ");
    const size_t length = strcspn(*list, " ");
    snprintf(entry, ENTRY_BYTES, "%.*s", (int)(length < ENTRY_BYTES ? length : ENTRY_BYTES - 1),
             *list);
    *list += length;
    for (char *c = entry; *c != '\0'; c++)
        if (*c == '_') *c = ' ';
    return length > 0;
}

static void take_movable(struct fovea_objects_config *objects, int32_t c)
{
    objects->movable[c / 32] |= 1u << c % 32;
}

/* The network's classes that are known to move. */
static void take_moving(struct fovea_objects_config *objects, const struct fv_model *model)
{
    for (size_t i = 0; i < sizeof moves / sizeof moves[0]; i++) {
        const int32_t c = class_of(model, moves[i]);
        if (c >= 0) take_movable(objects, c);
    }
}

static enum fovea_status refuse(const char *key, const char *entry, const char *expected,
                                struct fovea_error *error)
{
    char quoted[FV_TEXT_QUOTED_BYTES];
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: found %s, expected %s", key,
                           fv_text_quote(entry, quoted, sizeof quoted), expected);
}

static enum fovea_status refuse_height(const char *entry, struct fovea_error *error)
{
    char expected[64];
    snprintf(expected, sizeof expected, "class:metres, up to %d", FOVEA_OBJECT_HEIGHT_MAX_M);
    return refuse("objects.heights", entry, expected, error);
}

static enum fovea_status refuse_number(const char *entry, struct fovea_error *error)
{
    char expected[64];
    snprintf(expected, sizeof expected, "auto, labels or numbers from 0 to %d",
             FOVEA_OBJECT_CLASSES_MAX - 1);
    return refuse("objects.movable", entry, expected, error);
}

/* "class:metres", of which the class stays in `entry`. */
static bool take_height(char *entry, double *height)
{
    char *colon = strrchr(entry, ':');
    if (colon == NULL || colon == entry || !fv_text_number(colon + 1, height) ||
        !(*height > 0 && *height <= FOVEA_OBJECT_HEIGHT_MAX_M))
        return false;
    *colon = '\0';
    return true;
}

enum fovea_status fv_classes_check(const struct fv_settings *settings, struct fovea_error *error)
{
    char entry[ENTRY_BYTES];
    double number;
    for (const char *list = settings->movable; next(&list, entry);)
        if (fv_text_number(entry, &number) && !(number >= 0 && number < FOVEA_OBJECT_CLASSES_MAX &&
                                                number == (double)(int32_t)number))
            return refuse_number(entry, error);
    for (const char *list = settings->heights; next(&list, entry);)
        if (!take_height(entry, &number)) return refuse_height(entry, error);
    return FOVEA_OK;
}

enum fovea_status fv_classes_resolve(struct fv_settings *settings, const struct fv_model *model,
                                     struct fovea_error *error)
{
    struct fovea_objects_config *objects = &settings->runtime.objects;
    char entry[ENTRY_BYTES];
    for (const char *list = settings->movable; next(&list, entry);) {
        const int32_t c = class_of(model, entry);
        if (c >= 0)
            take_movable(objects, c);
        else if (strcmp(entry, "auto") == 0)
            take_moving(objects, model);
        else
            return refuse("objects.movable", entry,
                          "auto, labels or numbers of the network's classes", error);
    }
    for (const char *list = settings->heights; next(&list, entry);) {
        double height;
        if (!take_height(entry, &height)) return refuse_height(entry, error);
        const int32_t c = class_of(model, entry);
        if (c < 0)
            return refuse("objects.heights", entry, "a label or number of the network's classes",
                          error);
        objects->height_m[c] = (float)height;
    }
    return FOVEA_OK;
}

/* ---- the grid of free space ------------------------------------------------------------------ */

/* By the names that Cityscapes, ADE20K, CamVid and our own networks give them. */
static const char *const floors[] = {"floor",  "road",      "ground", "sidewalk", "pavement",
                                     "lane",   "parking",   "rug",    "carpet",   "crosswalk",
                                     "Road",   "Pavement",  "path",   "earth",    "field",
                                     "runway", "dirt track"};
static const char *const never_floor[] = {"sky", "Sky", "background", "other"};
/* They may be floor, or the robot. */
static const char *const nothing[] = {"void",
                                      "Void",
                                      "unlabeled",
                                      "unlabelled",
                                      "unlabelled void",
                                      "ego vehicle",
                                      "rectification border"};
static const char *const more_moves[] = {"rider", "caravan", "trailer",    "movable",   "animal",
                                         "Car",   "Person",  "Pedestrian", "Bicyclist", "cart"};

/* One of the four lists: its key, its entries, the names that `auto` stands for. */
struct labelled {
    const char *key, *list;
    enum fovea_grid_label label;
    struct {
        const char *const *names;
        size_t count;
    } known[2];
};

#define COUNT_OF(array) (sizeof(array) / sizeof(array)[0])

/* Whether a label is this name, or one of several names for one class ("floor, flooring"), as
 * ADE20K has them. */
static bool is_called(const char *label, const char *name)
{
    const size_t length = strlen(name);
    for (const char *at = label; *at != '\0'; at += strcspn(at, ",;/")) {
        at += strspn(at, ",;/ ");
        const size_t left = strcspn(at, ",;/");
        if (left >= length && strncmp(at, name, length) == 0 &&
            strspn(at + length, " ") == left - length)
            return true;
    }
    return false;
}

static void label_known(const struct fv_model *model, const struct labelled *of,
                        uint8_t labels[256])
{
    const int32_t first = model->header->decode.first_label,
                  last = (int32_t)model->header->label_count - first;
    for (int k = 0; k < 2; k++)
        for (size_t i = 0; i < of->known[k].count; i++)
            for (int32_t c = 0; c < last && c < 256; c++)
                if (labels[c] == FOVEA_GRID_OBSTACLE &&
                    is_called(fv_model_label(model, c + first), of->known[k].names[i]))
                    labels[c] = (uint8_t)of->label;
}

/* The entries of a list that name classes; `by_name`: those that `auto` stands for, of the classes
 * that no list names.
 */
static enum fovea_status label_list(const struct fv_model *model, const struct labelled *of,
                                    bool by_name, uint8_t labels[256], struct fovea_error *error)
{
    char entry[ENTRY_BYTES];
    for (const char *list = of->list; next(&list, entry);) {
        const int32_t c = class_below(model, entry, 256);
        if (c < 0 && strcmp(entry, "auto") != 0)
            return refuse(of->key, entry, "auto, labels or numbers of the network's classes",
                          error);
        if (c < 0 && by_name) label_known(model, of, labels);
        if (c < 0 || by_name) continue;
        if (labels[c] != FOVEA_GRID_OBSTACLE && labels[c] != of->label)
            return refuse(of->key, entry, "each class in one of the lists of the grid", error);
        labels[c] = (uint8_t)of->label;
    }
    return FOVEA_OK;
}

/* Whether a network's masks can make a grid: those of objects alone say nothing of the floor. */
static bool labels_pixels(const struct fv_model *model)
{
    return model != NULL && fv_detect_gives(model) == FV_DETECT_MASK;
}

void fv_classes_floor(const struct fv_settings *settings, const struct fv_model *model,
                      const struct fv_model *model2, char *text, size_t capacity)
{
    const struct fovea_grid_job_config *job = &settings->runtime.grid_job;
    const struct fv_model *labeller = labels_pixels(model) ? model : model2;
    size_t length = 0;
    text[0] = '\0';
    if (!job->enabled || !labels_pixels(labeller)) return;
    const int32_t first = labeller->header->decode.first_label;
    for (int32_t c = 0; c < 256; c++) {
        char number[16];
        snprintf(number, sizeof number, "class %d", (int)c);
        const bool named = c + first < (int32_t)labeller->header->label_count;
        if (job->labels[c] == FOVEA_GRID_FLOOR && length < capacity)
            length += (size_t)snprintf(text + length, capacity - length, "%s%.60s",
                                       length > 0 ? ", " : "",
                                       named ? fv_model_label(labeller, c + first) : number);
    }
}

enum fovea_status fv_classes_resolve_grid(struct fv_settings *settings,
                                          const struct fv_model *model,
                                          const struct fv_model *model2, struct fovea_error *error)
{
    struct fovea_grid_job_config *job = &settings->runtime.grid_job;
    const struct labelled lists[] = {
        {"grid.floor", settings->grid_floor, FOVEA_GRID_FLOOR, {{floors, COUNT_OF(floors)}}},
        {"grid.movable",
         settings->grid_movable,
         FOVEA_GRID_MOVABLE,
         {{moves, COUNT_OF(moves)}, {more_moves, COUNT_OF(more_moves)}}},
        {"grid.beyond",
         settings->grid_beyond,
         FOVEA_GRID_BEYOND,
         {{never_floor, COUNT_OF(never_floor)}}},
        {"grid.ignored",
         settings->grid_ignored,
         FOVEA_GRID_IGNORED,
         {{nothing, COUNT_OF(nothing)}}},
    };
    if (!job->enabled) return FOVEA_OK;
    const struct fv_model *labeller = labels_pixels(model) ? model : model2;
    if (!labels_pixels(labeller))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "grid.enabled: found no network that labels pixels, expected "
                               "detect.model or detect2.model to be one");
    memset(job->labels, FOVEA_GRID_OBSTACLE, sizeof job->labels);
    for (size_t i = 0; i < 2 * COUNT_OF(lists); i++) {
        const enum fovea_status status = label_list(labeller, &lists[i % COUNT_OF(lists)],
                                                    i >= COUNT_OF(lists), job->labels, error);
        if (status != FOVEA_OK) return status;
    }
    if (memchr(job->labels, FOVEA_GRID_FLOOR, sizeof job->labels) == NULL)
        return refuse("grid.floor", settings->grid_floor,
                      "at least one class of the network that is floor", error);
    return FOVEA_OK;
}
