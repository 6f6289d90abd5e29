#include "fault.h"

#include "support/uri_options.h"

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
#define FRACTION_OF(name) {#name, FV_URI_REAL, AT(fraction), 0.001, 1, "of the frames", NULL},
#define FV_FAULT(name, needs_last) FRACTION_OF(name)
#define FV_FAULT_OTHER(name) FRACTION_OF(name)
#include "faults.def"
};
enum { FIRST_KIND = sizeof option_table / sizeof option_table[0] - FV_FAULT_COUNT };
_Static_assert(sizeof option_table / sizeof option_table[0] <= 64, "a bit for each option given");
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

/* "KIND=FRACTION" is short for "kind=KIND&fraction=FRACTION": one in a schedule, as all of its
 * kinds strike the same frames. */
static enum fovea_status kind_of_row(uint64_t given, struct fv_fault_options *options,
                                     struct fovea_error *error)
{
    const uint64_t brief = given >> FIRST_KIND;
    bool twice = (brief & (brief - 1)) != 0 || options->kinds != 0;
    if (brief == 0) return FOVEA_OK;
    for (int row = 0; row < FIRST_KIND; row++)
        twice |= (given >> row & 1) && option_table[row].offset == AT(fraction);
    options->kinds = 1u << __builtin_ctzll(brief);
    if (!twice) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "fault: %s: found beside another kind or fraction, expected one of each "
                           "(one fault: may stand in another)",
                           kind_names[__builtin_ctzll(brief)]);
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
    enum fovea_status status = fv_uri_options_parse(&options_table, text, &o, &given, error);
    if (status == FOVEA_OK) status = kind_of_row(given, &o, error);
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
