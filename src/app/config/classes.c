#include "app/config/classes.h"

#include <string.h>

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

/* The class with this name or number; -1: none that the mask of movable classes can hold. */
static int32_t class_of(const struct fv_model *model, const char *name)
{
    const int32_t first = model->header->decode.first_label;
    double number;
    for (int32_t i = first; i < (int32_t)model->header->label_count; i++) {
        const char *label = fv_model_label(model, i);
        if (strcmp(label, name) == 0) return i - first < FOVEA_OBJECT_CLASSES_MAX ? i - first : -1;
    }
    if (!fv_text_number(name, &number) || !(number >= 0 && number < FOVEA_OBJECT_CLASSES_MAX))
        return -1;
    return number == (double)(int32_t)number ? (int32_t)number : -1;
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
