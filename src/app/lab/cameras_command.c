/* fovea cameras: the cameras of this host, and a URI for each. */
#include <stdio.h>
#include <stdlib.h>

#include "app/config/options.h"
#include "app/lab/commands.h"
#include "drivers/cameras.h"
#include "support/json.h"
#include "support/say.h"

/* ---- text ------------------------------------------------------------------------------------ */

static void print_mode(const struct fv_camera_mode *mode)
{
    printf("  format   %-5s", mode->format);
    if (mode->width > 0) printf(" %d x %d", mode->width, mode->height);
    if (mode->width_max > mode->width || mode->height_max > mode->height)
        printf(" to %d x %d", mode->width_max, mode->height_max);
    for (uint32_t i = 0; i < mode->rate_count; i++)
        printf("%s%.4g", i == 0 ? " at " : mode->any_rate ? " to " : ", ", mode->rates_hz[i]);
    printf("%s%s\n", mode->rate_count > 0 ? " Hz" : "", mode->read ? "" : " (not read by fovea)");
}

static void print_control(const struct fv_camera_control *control)
{
    printf("  control  %s", control->name);
    if (control->has_range) printf("  %g to %g", control->minimum, control->maximum);
    if (control->step > 1) printf(" by %g", control->step);
    if (control->has_range) printf(", default %g", control->standard);
    if (control->has_value) printf(", now %g", control->value);
    if (control->menu[0] != '\0') printf("; %s", control->menu);
    putchar('\n');
}

static void print_text(const struct fv_camera *camera)
{
    printf("%s  %s\n  uri      %s\n", camera->driver,
           camera->model[0] != '\0' ? camera->model : "(no name)", camera->uri);
    if (camera->node[0] != '\0')
        printf("  node     %s%s%s%s\n", camera->node, camera->place[0] != '\0' ? " (" : "",
               camera->place, camera->place[0] != '\0' ? ")" : "");
    if (camera->trouble[0] != '\0') printf("  trouble  %s\n", camera->trouble);
    for (uint32_t i = 0; i < camera->mode_count; i++)
        print_mode(&camera->modes[i]);
    for (uint32_t i = 0; i < camera->control_count; i++)
        print_control(&camera->controls[i]);
    putchar('\n');
}

/* ---- JSON ------------------------------------------------------------------------------------ */

static void json_pair(const char *key, const char *text)
{
    printf("\"%s\": ", key);
    fv_json_text(stdout, text);
    printf(", ");
}

static void json_mode(const struct fv_camera_mode *mode)
{
    json_pair("format", mode->format);
    printf("\"read\": %s, \"width\": %d, \"height\": %d, \"width_max\": %d, \"height_max\": %d, "
           "\"any_rate\": %s, \"rates_hz\": [",
           mode->read ? "true" : "false", mode->width, mode->height, mode->width_max,
           mode->height_max, mode->any_rate ? "true" : "false");
    for (uint32_t i = 0; i < mode->rate_count; i++)
        printf("%s%.6g", i == 0 ? "" : ", ", mode->rates_hz[i]);
    putchar(']');
}

static void json_control(const struct fv_camera_control *control)
{
    json_pair("name", control->name);
    if (control->has_range)
        printf("\"minimum\": %.12g, \"maximum\": %.12g, \"step\": %.12g, \"default\": %.12g, ",
               control->minimum, control->maximum, control->step, control->standard);
    if (control->has_value) printf("\"value\": %.12g, ", control->value);
    printf("\"menu\": ");
    fv_json_text(stdout, control->menu);
}

static void print_json(const struct fv_camera *camera, bool first)
{
    printf("%s\n  {", first ? "" : ",");
    json_pair("driver", camera->driver);
    json_pair("model", camera->model);
    json_pair("name", camera->name);
    json_pair("node", camera->node);
    json_pair("place", camera->place);
    json_pair("trouble", camera->trouble);
    json_pair("uri", camera->uri);
    printf("\n   \"modes\": [");
    for (uint32_t i = 0; i < camera->mode_count; i++) {
        printf("%s\n    {", i == 0 ? "" : ",");
        json_mode(&camera->modes[i]);
        putchar('}');
    }
    printf("],\n   \"controls\": [");
    for (uint32_t i = 0; i < camera->control_count; i++) {
        printf("%s\n    {", i == 0 ? "" : ",");
        json_control(&camera->controls[i]);
        putchar('}');
    }
    printf("]}");
}

/* ---- command --------------------------------------------------------------------------------- */

int fv_command_cameras(int argc, char **argv)
{
    bool json = false;
    const struct fv_option options[] = {
        {"json", NULL, FV_OPTION_FLAG, &json, "print the list as JSON"},
        {0},
    };
    int first;
    const enum fv_options_result result = fv_options_parse(options, "", 0, 0, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    struct fovea_error error = {.text = ""};
    struct fv_camera *cameras = calloc(FV_CAMERAS_MAX, sizeof *cameras);
    if (cameras == NULL) return fv_say_failed("out of memory");
    size_t count = 0;
    fv_cameras_v4l2(cameras, FV_CAMERAS_MAX, &count);
    if (fv_cameras_libcamera(cameras, FV_CAMERAS_MAX, &count, &error) != FOVEA_OK)
        fv_say("%s", error.text);
    if (json) putchar('[');
    for (size_t i = 0; i < count; i++) {
        if (json)
            print_json(&cameras[i], i == 0);
        else
            print_text(&cameras[i]);
    }
    if (json) printf("%s]\n", count > 0 ? "\n" : "");
    if (!json && count == 0)
        printf("no camera was found: is it plugged in, and may this user read /dev/video*?\n");
    free(cameras);
    return FV_EXIT_OK;
}
