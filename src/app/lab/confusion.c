#include "app/lab/confusion.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "detect/decode.h"
#include "support/json.h"
#include "support/text.h"

/* ---- the map --------------------------------------------------------------------------------- */

enum { MAP_BYTES_MAX = 1 << 20, LABELS = 256, IGNORED = -1, OTHER = -2 };

/* The network's class with this label or number; -1: none. */
static int32_t class_of(const struct fv_model *model, const char *name)
{
    const int32_t labels = (int32_t)fv_model_label_count(model);
    const int32_t classes = model->header->decode.classes;
    int64_t number;
    for (int32_t c = 0; c < FV_CONFUSION_CLASSES_MAX && c < labels; c++)
        if (strcmp(fv_detect_label(model, c), name) == 0) return c;
    if (!fv_text_integer(name, &number) || number < 0) return -1;
    return number < FV_CONFUSION_CLASSES_MAX && (classes <= 0 || number < classes) ? (int32_t)number
                                                                                   : -1;
}

/* The row of a class, a new one where it has none. */
static int32_t row_for(struct fv_confusion *c, int32_t class_id, const char *name)
{
    if (c->column_of[class_id] != FOVEA_SEGMENTATION_NONE) return c->column_of[class_id];
    snprintf(c->names[c->count], FV_CONFUSION_NAME_BYTES, "%.63s", name);
    c->column_of[class_id] = (uint8_t)c->count;
    return c->count++;
}

/* One line without its comment; `at` names it. */
static enum fovea_status take_line(struct fv_confusion *c, char *line, const struct fv_model *model,
                                   const char *at, struct fovea_error *error)
{
    char quoted[FV_TEXT_QUOTED_BYTES];
    line += strspn(line, " \t\r");
    size_t length = strlen(line);
    while (length > 0 && strchr(" \t\r", line[length - 1]) != NULL)
        line[--length] = '\0';
    if (length == 0) return FOVEA_OK;
    char *name = line + strcspn(line, " \t");
    if (*name != '\0') *name++ = '\0';
    name += strspn(name, " \t");
    int64_t label;
    if (!fv_text_integer(line, &label) || label < 0 || label >= LABELS || *name == '\0')
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: found %s, expected a label from 0 to 255 and a class of the network's, other or ignore",
            at, fv_text_quote(line, quoted, sizeof quoted));
    if (c->row_of[label] != IGNORED)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: found label %d again, expected once",
                               at, (int)label);
    if (strcmp(name, "ignore") == 0) return FOVEA_OK;
    const int32_t class_id = class_of(model, name);
    if (class_id < 0 && strcmp(name, "other") == 0) {
        c->row_of[label] = OTHER;
        return FOVEA_OK;
    }
    if (class_id < 0)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: found class %s, expected a label or number of the network's, other or ignore", at,
            fv_text_quote(name, quoted, sizeof quoted));
    c->row_of[label] = row_for(c, class_id, name);
    return FOVEA_OK;
}

enum fovea_status fv_confusion_open(struct fv_confusion *c, const char *path,
                                    const struct fv_model *model, struct fovea_error *error)
{
    char *text, at[320];
    size_t bytes;
    memset(c, 0, sizeof *c);
    memset(c->column_of, FOVEA_SEGMENTATION_NONE, sizeof c->column_of);
    for (int i = 0; i < LABELS; i++)
        c->row_of[i] = IGNORED;
    enum fovea_status status = fv_text_read(path, MAP_BYTES_MAX, &text, &bytes, error);
    if (status != FOVEA_OK) return status;
    const size_t length = strlen(text);
    if (length < bytes) {
        free(text);
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.280s: byte %zu: found a zero byte, expected text", path, length);
    }
    static const char mark[] = "\xef\xbb\xbf"; /* a byte order mark, as some editors begin a file */
    int number = 0;
    for (char *line = text + (strncmp(text, mark, 3) == 0 ? 3 : 0), *next;
         line != NULL && status == FOVEA_OK; line = next) {
        next = strchr(line, '\n');
        if (next != NULL) *next++ = '\0';
        line[strcspn(line, "#")] = '\0';
        snprintf(at, sizeof at, "%.280s: line %d", path, ++number);
        status = take_line(c, line, model, at, error);
    }
    free(text);
    if (status == FOVEA_OK && c->count == 0)
        status = fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.280s: found no class of the network's, expected lines as '8 car'", path);
    snprintf(c->names[c->count], FV_CONFUSION_NAME_BYTES, "%s",
             class_of(model, "other") < 0 ? "other" : "none of them");
    for (int i = 0; i < LABELS; i++) {
        if (c->row_of[i] == OTHER) c->row_of[i] = c->count;
        if (c->column_of[i] == FOVEA_SEGMENTATION_NONE) c->column_of[i] = (uint8_t)c->count;
    }
    return status;
}

/* ---- the matrix ------------------------------------------------------------------------------ */

enum fovea_status fv_confusion_add(struct fv_confusion *c, const uint8_t *labels,
                                   const struct fovea_segmentation *s)
{
    const size_t pixels = (size_t)s->image_width * (size_t)s->image_height;
    uint8_t columns[256], *seen = malloc(pixels);
    if (seen == NULL) return FOVEA_ERROR_SYSTEM;
    memset(columns, c->count, sizeof columns);
    for (uint32_t i = 0; i < s->count; i++)
        if (s->list[i].class_id < FOVEA_SEGMENTATION_NONE)
            columns[i] = c->column_of[s->list[i].class_id];
    fovea_segmentation_enlarge(s, columns, seen);
    for (size_t i = 0; i < pixels; i++) {
        const int32_t row = c->row_of[labels[i]];
        if (row < 0)
            c->ignored++;
        else
            c->cells[row][seen[i]]++;
        c->pixels += row >= 0;
    }
    free(seen);
    c->pictures++;
    return FOVEA_OK;
}

/* Intersection over union of a row; NaN where neither labels nor network have it. */
static double iou_of(const struct fv_confusion *c, int32_t row)
{
    uint64_t either = 0;
    for (int32_t i = 0; i <= c->count; i++)
        either += c->cells[row][i] + (i == row ? 0 : c->cells[i][row]);
    return either == 0 ? (double)__builtin_nanf("") : (double)c->cells[row][row] / (double)either;
}

/* Over the judged classes that labels or network have; NaN: none. */
static double mean_iou(const struct fv_confusion *c)
{
    double sum = 0;
    int count = 0;
    for (int32_t i = 0; i < c->count; i++) {
        const double iou = iou_of(c, i);
        if (iou != iou) continue;
        sum += iou;
        count++;
    }
    return count == 0 ? (double)__builtin_nanf("") : sum / count;
}

static void print_number(const char *before, double value)
{
    if (value == value)
        printf("%s%.6f", before, value);
    else
        printf("%snull", before);
}

static void print_json(const struct fv_confusion *c)
{
    printf("{\"pictures\": %llu, \"pixels\": %llu, \"ignored\": %llu, \"classes\": [",
           (unsigned long long)c->pictures, (unsigned long long)c->pixels,
           (unsigned long long)c->ignored);
    for (int32_t i = 0; i <= c->count; i++) {
        if (i > 0) printf(", ");
        fv_json_text(stdout, c->names[i]);
    }
    printf("], \"confusion\": [");
    for (int32_t row = 0; row <= c->count; row++) {
        printf("%s[", row == 0 ? "" : ", ");
        for (int32_t column = 0; column <= c->count; column++)
            printf("%s%llu", column == 0 ? "" : ", ", (unsigned long long)c->cells[row][column]);
        printf("]");
    }
    printf("], \"iou\": [");
    for (int32_t i = 0; i < c->count; i++)
        print_number(i == 0 ? "" : ", ", iou_of(c, i));
    print_number("], \"mean_iou\": ", mean_iou(c));
    printf("}\n");
}

void fv_confusion_print(const struct fv_confusion *c, bool json)
{
    if (json) {
        print_json(c);
        return;
    }
    printf("%llu pictures, %llu pixels judged, %llu ignored\n\n%-20s%8s", //
           (unsigned long long)c->pictures, (unsigned long long)c->pixels,
           (unsigned long long)c->ignored, "labelled \\ seen as", "IoU");
    for (int32_t i = 0; i <= c->count; i++)
        printf(" %12.12s", c->names[i]);
    for (int32_t row = 0; row <= c->count; row++) {
        const double iou = row == c->count ? (double)__builtin_nanf("") : iou_of(c, row);
        printf("\n%-20.20s", c->names[row]);
        if (iou == iou)
            printf("%8.4f", iou);
        else
            printf("%8s", "-");
        for (int32_t column = 0; column <= c->count; column++)
            printf(" %12llu", (unsigned long long)c->cells[row][column]);
    }
    const double mean = mean_iou(c);
    printf("\n%-20s", "mean");
    if (mean == mean)
        printf("%8.4f\n", mean);
    else
        printf("%8s\n", "-");
}
