/* The guidance of `fovea-calibrate camera`: a simulated user holds the board as it asks, through
 * random true cameras; focal lengths are found with the pictures that it took.
 *
 * FOVEA_LONG: cameras of each model (default 1), FOVEA_SEED: the first (default 2, then even). */
#include "calibrate/guide.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "common/simulated_boards.h"

#include "common/cmocka_cpp.h"

using namespace calibrate;
using namespace simulated;

namespace
{

int number_of(const char *name, int otherwise)
{
    const char *text = std::getenv(name);
    return text != nullptr ? (int)std::strtol(text, nullptr, 10) : otherwise;
}

/* Hold the board as it is wanted, as well as a person can, `inward` of the way to the image's
 * middle; false: it is not seen whole. */
bool see_held(const fovea_camera &camera, Random &random, const Wanted &wanted, double inward,
              View &view)
{
    const double size = board.square_m * (board.columns - 1);
    const double height = board.square_m * (board.rows - 1);
    double at[2] = {(wanted.column + random.between(.2, .8)) * WIDTH / Guide::COLUMNS,
                    (wanted.row + random.between(.2, .8)) * HEIGHT / Guide::ROWS};
    at[0] += inward * (.5 * WIDTH - at[0]);
    at[1] += inward * (.5 * HEIGHT - at[1]);
    double towards[3], z[3], x[3], y[3],
        tilt[2] = {random.between(-.1, .1), random.between(-.1, .1)};
    if (fovea_camera_unproject(&camera, at, towards, nullptr) != FOVEA_OK) return false;
    const double lean = random.between(.7, 1.1);
    /* z points away from the camera; the side that it leans to is further away */
    if (wanted.nearer == Nearer::left) tilt[0] -= lean;
    if (wanted.nearer == Nearer::right) tilt[0] += lean;
    if (wanted.nearer == Nearer::top) tilt[1] -= lean;
    if (wanted.nearer == Nearer::bottom) tilt[1] += lean;
    const double share = wanted.close ? random.between(.6, .85) : random.between(.2, .3);
    const double distance = size * camera.fx / WIDTH / share;
    const double turn = random.between(-.3, .3), along[3] = {std::cos(turn), std::sin(turn), 0};
    for (int i = 0; i < 3; i++)
        z[i] = towards[i] + (i < 2 ? tilt[i] : 0);
    normalise(z);
    cross(z, along, y);
    normalise(y);
    cross(y, z, x);
    view.corners.clear();
    for (const Point &point : board.points()) {
        double p[3], pixel[2];
        const double a = point[0] - .5 * size, b = point[1] - .5 * height;
        for (int i = 0; i < 3; i++)
            p[i] = distance * towards[i] + a * x[i] + b * y[i];
        if (fovea_camera_project(&camera, p, pixel, nullptr) != FOVEA_OK) return false;
        if (pixel[0] < 3 || pixel[1] < 3 || pixel[0] > WIDTH - 4 || pixel[1] > HEIGHT - 4)
            return false;
        view.corners.push_back(
            {pixel[0] + NOISE_PX * random.gauss(), pixel[1] + NOISE_PX * random.gauss()});
    }
    return true;
}

/* As far out as the board is seen whole. */
bool see_wanted(const fovea_camera &camera, Random &random, const Wanted &wanted, View &view)
{
    for (double inward = 0; inward < .95; inward += .1)
        if (see_held(camera, random, wanted, inward, view)) return true;
    return false;
}

/* Of 40, the program's default, the focal length must be right; some cameras are certain later. */
constexpr int VIEWS_USUAL = 40, VIEWS_MAX = 60;

struct Outcome {
    int pictures = 0;
    bool certain = false;
    double focal_off = 1, deviation = NAN;
};

/* The board may be held upside down: its first corner is then at the other end. */
void turn(View &view, bool turned)
{
    if (turned) std::reverse(view.corners.begin(), view.corners.end());
}

Outcome guided(Model model, int seed, bool turned)
{
    Random random = {std::mt19937_64((unsigned)seed)};
    const fovea_camera camera = true_camera(model, random);
    Guide guide(board, {model}, WIDTH, HEIGHT, VIEWS_MAX, true);
    Outcome outcome;
    for (int hold = 0; hold < 600 && !guide.done(); hold++) {
        View view;
        view.width = WIDTH;
        view.height = HEIGHT;
        view.edge_px = random.between(2, 2.4);
        if (!see_wanted(camera, random, guide.wanted(), view)) continue;
        turn(view, turned);
        Advice advice = guide.look(view); /* it has just come */
        assert_false(advice.take);
        advice = guide.look(view);
        if (advice.take) guide.add(view);
    }
    outcome.pictures = (int)guide.views().size();
    outcome.certain = guide.certain();
    outcome.deviation = guide.focal_deviation();
    Solution solution;
    SolveOptions options;
    std::string error;
    options.model = model;
    std::vector<View> views = guide.views();
    if (views.size() > VIEWS_USUAL) views.resize(VIEWS_USUAL);
    if (solve(board, views, WIDTH, HEIGHT, options, solution, error))
        outcome.focal_off = std::max(std::fabs(solution.camera.fx / camera.fx - 1),
                                     std::fabs(solution.camera.fy / camera.fy - 1));
    return outcome;
}

} // namespace

static void find_focal_lengths(const std::vector<Model> &models, bool turned)
{
    const int count = number_of("FOVEA_LONG", 1), first = number_of("FOVEA_SEED", 2);
    const bool all_certain = std::getenv("FOVEA_LONG") == nullptr && first == 2;
    for (const Model model : models) {
        int within = 0, certain = 0, most = 0, sum = 0;
        double worst = 0;
        for (int i = 0; i < count; i++) {
            const Outcome outcome = guided(model, first + 2 * i, turned);
            within += outcome.focal_off < .001;
            certain += outcome.certain;
            most = std::max(most, outcome.pictures);
            sum += outcome.pictures;
            worst = std::max(worst, outcome.focal_off);
            if (outcome.focal_off >= .001 || !outcome.certain)
                printf("%s seed %d: %d pictures, off by %.3f %%, deviation %.3f %%\n",
                       model_name(model), first + 2 * i, outcome.pictures, 100 * outcome.focal_off,
                       100 * outcome.deviation);
        }
        printf("%s: %d of %d within 0.1 %%, worst %.3f %%, %d certain, %.1f pictures, at most %d\n",
               model_name(model), within, count, 100 * worst, certain, (double)sum / count, most);
        assert_int_equal(within, count);
        if (all_certain) assert_int_equal(certain, count);
    }
}

static void focal_lengths_are_found_with_the_pictures_that_it_asks_for(void **)
{
    find_focal_lengths({Model::radtan, Model::equidistant, Model::rational}, false);
}

static void the_board_may_be_upside_down(void **)
{
    find_focal_lengths({Model::radtan, Model::equidistant}, true);
}

static void it_says_why_a_frame_is_not_taken(void **)
{
    Random random = {std::mt19937_64(5)};
    const fovea_camera camera = true_camera(Model::radtan, random);
    Guide guide(board, {Model::radtan}, WIDTH, HEIGHT, 40, true);
    View view, other;
    assert_string_equal(guide.look(view).trouble.c_str(), "no board in the picture");
    while (!see_wanted(camera, random, guide.wanted(), view))
        continue;
    view.edge_px = 2;
    assert_string_equal(guide.look(view).trouble.c_str(), "hold the board still");
    assert_true(guide.look(view).take);
    guide.add(view);
    assert_string_equal(guide.look(view).trouble.c_str(), "such a picture was taken");
    while (!see_wanted(camera, random, guide.wanted(), other))
        continue;
    other.edge_px = 4;
    (void)guide.look(other);
    assert_true(guide.look(other).trouble.find("blurred") == 0);
    other.edge_px = 2;
    assert_true(guide.look(other).take);
}

static void ask_for_what_is_missing(bool turned)
{
    Random random = {std::mt19937_64(7)};
    const fovea_camera camera = true_camera(Model::radtan, random);
    Guide guide(board, {Model::radtan}, WIDTH, HEIGHT, 40, false);
    Wanted middle;
    middle.nearer = Nearer::left;
    middle.close = false;
    for (int i = 0; i < 60; i++) {
        View view;
        view.edge_px = 2;
        if (!see_wanted(camera, random, middle, view)) continue;
        turn(view, turned);
        if (guide.look(view).take) guide.add(view);
    }
    /* It takes no more of the same, and asks for the corners and the other tilts. */
    assert_true(guide.views().size() < 20 && !guide.done());
    assert_true(guide.wanted().row != 1 || guide.wanted().column != 1);
    assert_true(guide.wanted().nearer != Nearer::left && guide.wanted().nearer != Nearer::none);
    const std::string text = guide.look(View()).text;
    assert_true(text.find("of the picture") != std::string::npos);
    assert_true(text.find("nearer to the camera") != std::string::npos);
}

static void it_asks_for_what_is_missing(void **)
{
    ask_for_what_is_missing(false);
    ask_for_what_is_missing(true);
}

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(it_says_why_a_frame_is_not_taken),
        cmocka_unit_test(it_asks_for_what_is_missing),
        cmocka_unit_test(focal_lengths_are_found_with_the_pictures_that_it_asks_for),
        cmocka_unit_test(the_board_may_be_upside_down),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
