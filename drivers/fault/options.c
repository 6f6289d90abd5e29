#include "fault.h"

#include <stdio.h>
#include <string.h>

#include "support/uri_options.h"

enum { OPTIONS_BYTES = 2048 };

static const char *const kind_names[] = {
#define FV_FAULT(name, needs_last) #name,
#define FV_FAULT_OTHER(name) #name,
#include "faults.def"
    NULL};

#define AT(member) offsetof(struct fv_fault_options, member)
static const struct fv_uri_option option_table[] = {
    {"kind", FV_URI_SET, AT(kinds), 0, 0, "one or more, with commas between, of:"
#define FV_FAULT(name, needs_last) " " #name
#define FV_FAULT_OTHER(name) " " #name
#include "faults.def"
     ,
     kind_names},
#define FV_FAULT_OPTION(name, kind, type, member, value, low, high, unit)                          \
    {#name, FV_URI_##kind, AT(member), low, high, unit, NULL},
#include "options.def"
#undef FV_FAULT_OPTION
};
static const struct fv_uri_table options_table = {.scheme = "fault",
                                                  .options = option_table,
                                                  .count =
                                                      sizeof option_table / sizeof option_table[0]};

#define BIT(name) (1u << FV_FAULT_##name)
/* Kinds beside which others would silently do nothing, as all of a schedule strike the same frames:
 * a frame that does not come has no picture and no samples, a picture that is one level is no
 * longer the last good one, and only one frame is held back at a time. */
static const struct {
    enum fv_fault_kind kind;
    uint32_t idle; /* bits of those that do nothing beside it */
} hiding[] = {
    {FV_FAULT_drop, ~BIT(drop)},
    {FV_FAULT_unplug, BIT(drop) - 1},
    {FV_FAULT_black, BIT(freeze)},
    {FV_FAULT_white, BIT(freeze) | BIT(black)},
    {FV_FAULT_delay, BIT(duplicate) | BIT(reorder)},
    {FV_FAULT_reorder, BIT(duplicate)},
    {FV_FAULT_imu_stuck, BIT(imu_bias) | BIT(imu_saturate)},
    {FV_FAULT_imu_unplug, BIT(imu_unplug) - BIT(imu_drop)},
};

static enum fovea_status kinds_check(uint32_t kinds, struct fovea_error *error)
{
    for (size_t i = 0; i < sizeof hiding / sizeof hiding[0]; i++) {
        const uint32_t idle = kinds & hiding[i].idle;
        if ((kinds & fv_fault_bit(hiding[i].kind)) == 0 || idle == 0) continue;
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "fault: kind: found %s beside %s, where it does nothing, expected one of them (one fault: may stand in another)",
            kind_names[__builtin_ctz(idle)], kind_names[hiding[i].kind]);
    }
    return FOVEA_OK;
}

static bool is_kind(const char *name)
{
    for (int i = 0; kind_names[i] != NULL; i++)
        if (strcmp(kind_names[i], name) == 0) return true;
    return false;
}

/* "KIND=FRACTION" is short for "kind=KIND&fraction=FRACTION"; there is one in a schedule, as all of
 * its kinds strike the same frames. False: it does not fit. */
static bool written_out(const char *text, char out[OPTIONS_BYTES])
{
    size_t length = 0;
    out[0] = '\0';
    for (const char *at = text; *at != '\0';) {
        char name[FV_URI_WORD_BYTES];
        const char *value = at;
        const size_t whole = strcspn(at, "&");
        fv_uri_next_word(&value, "=&", name);
        const bool is_short = *value++ == '=' && is_kind(name);
        const int more =
            is_short ? snprintf(out + length, OPTIONS_BYTES - length, "%skind=%s&fraction=%.*s",
                                length > 0 ? "&" : "", name, (int)(at + whole - value), value)
                     : snprintf(out + length, OPTIONS_BYTES - length, "%s%.*s",
                                length > 0 ? "&" : "", (int)whole, at);
        if (more < 0 || length + (size_t)more >= OPTIONS_BYTES) return false;
        length += (size_t)more;
        at += whole + (at[whole] == '&');
    }
    return true;
}

enum fovea_status fv_fault_options_parse(const char *text, struct fv_fault_options *options,
                                         struct fovea_error *error)
{
    struct fv_fault_options o = {
        .kinds = 0,
#define FV_FAULT_OPTION(name, kind, type, member, value, low, high, unit) .member = value,
#include "options.def"
#undef FV_FAULT_OPTION
    };
    uint64_t given;
    char whole[OPTIONS_BYTES];
    const enum fovea_status status = fv_uri_options_parse(
        &options_table, written_out(text, whole) ? whole : text, &o, &given, error);
    if (status != FOVEA_OK) return status;
    if (o.kinds == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "fault: kind: found none behind the last '?', expected %s",
                               option_table[0].unit);
    if (o.longest < o.shortest)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "fault: longest: found %d frames, expected at least those of shortest, %d",
            (int)o.longest, (int)o.shortest);
    *options = o;
    return kinds_check(o.kinds, error);
}
