/* fovea-calibrate hand-eye: a camera on a body, from poses and pictures of a board. */
#include <algorithm>
#include <cstdio>

#include "calibrate/hand_eye.h"
#include "calibrate/heard_poses.h"
#include "calibrate/html.h"
#include "calibrate/json_text.h"
#include "calibrate/known_command.h"
#include "calibrate/outputs.h"
#include "calibrate/report.h"
#include "calibrate/report_page.h"
#include "support/text.h"
extern "C" {
#include "support/say.h"
}

namespace calibrate
{
namespace
{

constexpr int VIEWS_MAX_DEFAULT = 40;
constexpr double DEGREE = 57.29577951308232;

struct Given : KnownGiven {
    std::string poses, lcm_url, listen;
    /* A channel of LCM; nullptr: `poses` is a file. */
    const char *channel() const
    {
        constexpr size_t scheme = 4;
        return poses.compare(0, scheme, "lcm:") == 0 ? poses.c_str() + scheme : nullptr;
    }
};

struct HandEyeReport : KnownReport {
    HandEyeSolution solution;
    std::string poses; /* as given */
};

int check(const Given &given, Board &board, int64_t &views_max)
{
    int status = known_check("hand-eye", given, board);
    if (status != FV_EXIT_OK) return status;
    if (given.poses.empty())
        return fv_say_wrong(
            "fovea-calibrate hand-eye: found no --poses, expected lcm:CHANNEL or a file with lines "
            "of stamp x y z qx qy qz qw");
    if (given.channel() == nullptr && !(given.lcm_url.empty() && given.listen.empty()))
        return fv_say_wrong("fovea-calibrate hand-eye: found --%s without --poses lcm:CHANNEL, "
                            "expected both",
                            given.listen.empty() ? "lcm-url" : "listen");
    status = views_check(given.views, VIEWS_MAX_DEFAULT, 3, views_max);
    if (status != FV_EXIT_OK) return status;
    if (given.channel() != nullptr) return known_files(given);
    return known_files(given, {{"--poses", given.poses, false}});
}

Rigid from_rows(const double rows[12])
{
    Rigid T;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            T.R(i, j) = rows[4 * i + j];
        T.t[i] = rows[4 * i + 3];
    }
    return T;
}

/* Pictures whose times no pose covers: two clocks more often than a wrong file. */
int other_times(const Given &given, const fv_poses &poses, const std::vector<View> &views)
{
    int64_t first = INT64_MAX, last = 0;
    for (const View &view : views) {
        if (view.stamp_ns < 0) continue;
        first = std::min(first, view.stamp_ns);
        last = std::max(last, view.stamp_ns);
    }
    return fv_say_wrong("%s: found poses of %.3f to %.3f s, expected some at the times of the "
                        "pictures, %.3f to %.3f s: both must be of one clock",
                        given.poses.c_str(), 1e-9 * (double)poses.by_stamp[0].stamp_ns,
                        1e-9 * (double)poses.by_stamp[poses.count - 1].stamp_ns,
                        1e-9 * (double)first, 1e-9 * (double)last);
}

/* By stamp, or by their order where no picture has one and there are as many. */
int match(const Given &given, const std::vector<View> &views, const fv_poses &poses,
          std::vector<BodyPose> &found)
{
    bool stamped = false, any = false;
    for (const View &view : views)
        stamped |= view.stamp_ns >= 0;
    for (size_t v = 0; v < views.size(); v++) {
        double rows[12];
        const bool ordered = !stamped && poses.count == views.size();
        const int64_t stamp_ns = ordered ? poses.by_stamp[v].stamp_ns : views[v].stamp_ns;
        BodyPose pose;
        pose.known = stamp_ns >= 0 && fv_poses_at(&poses, stamp_ns, v, rows);
        if (pose.known) pose.T_world_body = from_rows(rows);
        any |= pose.known;
        found.push_back(pose);
    }
    if (stamped) return !any && poses.count > 0 ? other_times(given, poses, views) : FV_EXIT_OK;
    if (poses.count == views.size()) return FV_EXIT_OK;
    return fv_say_wrong("%s: found %zu poses for %zu pictures without stamps, expected as many, or "
                        "pictures with stamps as names",
                        given.poses.c_str(), poses.count, views.size());
}

constexpr double IDENTITY[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

/* Poses of a file, or none. */
struct FilePoses {
    fv_poses list = {};
    FilePoses() = default;
    FilePoses(const FilePoses &) = delete;
    FilePoses &operator=(const FilePoses &) = delete;
    ~FilePoses()
    {
        fv_poses_free(&list);
    }
};

int match_heard(const Given &given, const Collection &collection, HeardPoses &heard,
                std::vector<BodyPose> &found)
{
    std::vector<fv_pose> list = heard.end(collection.clock);
    if (list.empty())
        return fv_say_wrong("%s: heard no pose while pictures were taken, expected bot_core.pose_t "
                            "on that channel (--lcm-url, --listen)",
                            given.poses.c_str());
    fv_poses poses = {};
    poses.by_stamp = list.data();
    poses.count = list.size();
    std::copy(IDENTITY, IDENTITY + 12, poses.T_body_cam);
    return match(given, collection.views, poses, found);
}

/* Pictures, and the poses of the body at their times. */
int collect_posed(const Given &given, const Board &board, int views_max, Collection &collection,
                  fovea_camera &camera, std::vector<BodyPose> &poses)
{
    HeardPoses heard;
    fovea_error error;
    const char *channel = given.channel();
    if (channel != nullptr && heard.open(given.lcm_url, given.listen, channel, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    FilePoses file; /* a wrong one is named before pictures are searched */
    if (channel == nullptr &&
        fv_poses_read(given.poses.c_str(), FV_POSES_TUM, IDENTITY, &file.list, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    const int status =
        collect_known(given.source, given.camera, board, views_max, collection, camera);
    if (status != FV_EXIT_OK) return status;
    return channel != nullptr ? match_heard(given, collection, heard, poses)
                              : match(given, collection.views, file.list, poses);
}

std::string configuration(const HandEyeReport &report)
{
    const HandEyeSolution &s = report.solution;
    return formatted("# The camera on the body, by fovea-calibrate hand-eye of %s: %s.\n"
                     "# Rotation +- %.3f %.3f %.3f degrees about the body's axes, place +- %.4f "
                     "%.4f %.4f m.\n",
                     report.date.c_str(), grade_name(report.verdict.grade), DEGREE * s.stdev[0],
                     DEGREE * s.stdev[1], DEGREE * s.stdev[2], s.stdev[3], s.stdev[4], s.stdev[5]) +
           T_body_cam_key(rows_of(s.T_body_cam));
}

std::string json(const HandEyeReport &report)
{
    const HandEyeSolution &s = report.solution;
    std::string text = known_json(report);
    if (s.views_used > 0)
        text += ",\n  \"T_body_cam\": " + json_numbers(rows_of(s.T_body_cam).data(), 12) +
                ",\n  \"rotation_stdev_rad\": " + json_numbers(s.stdev.data(), 3) +
                ",\n  \"translation_stdev_m\": " + json_numbers(s.stdev.data() + 3, 3) +
                ",\n  \"T_world_board\": " + json_numbers(rows_of(s.T_world_board).data(), 12) +
                ",\n  \"pose_noise_rad\": " + json_number(s.pose_noise_rad) +
                ",\n  \"pose_noise_m\": " + json_number(s.pose_noise_m) +
                ",\n  \"noise_px\": " + json_number(s.noise_px) +
                ",\n  \"angle_off_rad\": " + json_number(s.angle_off_rad) +
                formatted(",\n  \"views_used\": %d", s.views_used);
    text += ",\n  \"turn_rad\": " + json_number(s.turn_rad) +
            ",\n  \"second_turn_rad\": " + json_number(s.second_turn_rad) + ",\n";
    return text + json_left_out(pictures_left_out(report.views, s.left_out));
}

std::string html(const HandEyeReport &report)
{
    const HandEyeSolution &s = report.solution;
    std::string page =
        known_header(report, "The camera on the body", "key", " Poses: " + report.poses + ".");
    if (s.views_used > 0) {
        page += section("place", "The camera in the body's frame",
                        values_table(place_rows(pose_of(s.T_body_cam), s.stdev)) + "<p>" +
                            datum("views_used", s.views_used, "%.0f") +
                            " pictures. Noise of the body's poses: " +
                            datum("pose_noise_degrees", DEGREE * s.pose_noise_rad) + " degrees, " +
                            datum("pose_noise_mm", 1e3 * s.pose_noise_m) +
                            " mm; of corners: " + datum("noise_px", s.noise_px) + " px.</p>\n");
    }
    page += left_out_section(pictures_left_out(report.views, s.left_out));
    return html_page(report.verdict.grade, page);
}

void print(const HandEyeReport &report)
{
    const HandEyeSolution &s = report.solution;
    print_left_out(pictures_left_out(report.views, s.left_out));
    if (s.views_used > 0) {
        const Pose place = pose_of(s.T_body_cam);
        printf("place     %.2f %.2f %.2f mm in the body (+- %.2g %.2g %.2g)\n"
               "rotation  %.3f %.3f %.3f degrees about its axes (+- %.2g %.2g %.2g)\n"
               "noise     of poses %.3f degrees, %.2f mm; of corners %.3f px; %d pictures\n",
               1e3 * place[3], 1e3 * place[4], 1e3 * place[5], 1e3 * s.stdev[3], 1e3 * s.stdev[4],
               1e3 * s.stdev[5], DEGREE * place[0], DEGREE * place[1], DEGREE * place[2],
               DEGREE * s.stdev[0], DEGREE * s.stdev[1], DEGREE * s.stdev[2],
               DEGREE * s.pose_noise_rad, 1e3 * s.pose_noise_m, s.noise_px, s.views_used);
    }
    print_verdict(report.verdict);
}

} // namespace

int command_hand_eye(int argc, char **argv)
{
    Given given;
    const std::vector<Option> options = known_options(
        given,
        {{"poses", "FILE|lcm:CHANNEL", &given.poses,
          "poses of the body: a file with a line each, stamp x y z qx qy qz qw; or a channel of "
          "bot_core.pose_t, heard while pictures are taken"},
         {"lcm-url", "URL", &given.lcm_url, lcm_url_help},
         {"listen", "WHOM", &given.listen, listen_help}},
        "write the key T_body_cam of Fovea's configuration; not when the verdict is fail",
        "pictures to take from a URI (default 40)");
    std::vector<std::string> operands;
    int status;
    if (!options_parse(argc, argv, options, "", 0, operands, &status)) return status;
    HandEyeReport report;
    int64_t views_max;
    status = check(given, report.board, views_max);
    if (status != FV_EXIT_OK) return status;
    Collection collection;
    fovea_camera camera;
    std::vector<BodyPose> poses;
    status = collect_posed(given, report.board, (int)views_max, collection, camera, poses);
    if (status != FV_EXIT_OK) return status;
    known_begin(given, collection, report);
    report.poses = given.poses;
    std::string error;
    if (solve_hand_eye(report.board, report.views, poses, camera, report.solution, error))
        report.verdict = judge_hand_eye(report.solution);
    else
        add_reason(report.verdict, Grade::fail, "%s", error.c_str());
    print(report);
    return known_write(given, report, json(report), html(report), configuration(report));
}

} // namespace calibrate
