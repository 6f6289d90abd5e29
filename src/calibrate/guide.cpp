#include "calibrate/guide.h"

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

constexpr double EDGE_MAX_PX = 5;    /* wider edges are blurred, */
constexpr double EDGE_FACTOR = 1.6;  /* and those so much wider than the taken pictures' */
constexpr double SIDES_TILTED = .08; /* logarithm of the ratio of opposite sides */
constexpr double CLOSE_SHARE = .45, DISTANT_SHARE = .3; /* of the image's width */
/* Enough of each kind. */
constexpr int TILTED = 4, CLOSE = 6, DISTANT = 3;
constexpr int PART_CORNERS_MIN = 10, EMPTY_MAX = 1; /* parts with fewer, at the end */
constexpr int VIEWS_MIN = 10, SOLVE_FROM = 6;
constexpr double FOCAL_CERTAIN = .00033; /* deviation over value: .1 % is three of them */
constexpr double PROJECTION_CERTAIN_PX = .25;
constexpr int ASK_ANOTHER = 20; /* frames of a still board without a picture: ask for another, */
constexpr int TAKE_ANY = 60;    /* or take what is new */
constexpr double MODEL_DOUBTED_PX = 1; /* RMS with which another model is tried */

double length(const Pixel &a, const Pixel &b)
{
    return std::hypot(a[0] - b[0], a[1] - b[1]);
}

int part_of(const Pixel &pixel, int width, int height)
{
    const int column = std::clamp((int)(pixel[0] * Guide::COLUMNS / width), 0, Guide::COLUMNS - 1);
    const int row = std::clamp((int)(pixel[1] * Guide::ROWS / height), 0, Guide::ROWS - 1);
    return row * Guide::COLUMNS + column;
}

} // namespace

double mean_shift(const View &a, const View &b)
{
    double sum = 0;
    int count = 0;
    for (size_t i = 0; i < a.corners.size() && i < b.corners.size(); i++) {
        if (!seen(a.corners[i]) || !seen(b.corners[i])) continue;
        sum += std::hypot(a.corners[i][0] - b.corners[i][0], a.corners[i][1] - b.corners[i][1]);
        count++;
    }
    return count > 0 ? sum / count : INFINITY;
}

Guide::Guide(const Board &board, const std::vector<Model> &models, int width, int height,
             int views_max, bool live)
    : board_(board), models_(models), width_(width), height_(height), views_max_(views_max),
      live_(live)
{
    choose_wanted();
}

/* By the largest rectangle of the board that has its four corners seen, at its outer rows. */
Placed Guide::place(const View &view) const
{
    Placed placed = {{0, 0}, 0, Nearer::none};
    int count = 0;
    double low = INFINITY, high = -INFINITY;
    for (const Pixel &corner : view.corners) {
        if (!seen(corner)) continue;
        placed.middle[0] += corner[0];
        placed.middle[1] += corner[1];
        low = std::min(low, corner[0]);
        high = std::max(high, corner[0]);
        count++;
    }
    if (count == 0) return placed;
    placed.middle = {placed.middle[0] / count, placed.middle[1] / count};
    placed.width_share = (high - low) / width_;
    const size_t columns = (size_t)board_.point_columns(), rows = (size_t)board_.point_rows();
    if (view.corners.size() != columns * rows) return placed;
    /* Around the board, from whichever corner is first in it. */
    const Pixel around[4] = {view.corners[0], view.corners[columns - 1],
                             view.corners[rows * columns - 1], view.corners[(rows - 1) * columns]};
    if (!std::all_of(around, around + 4, seen)) return placed;
    size_t first = 0; /* at the top left of the picture */
    for (size_t i = 1; i < 4; i++)
        if (around[i][0] + around[i][1] < around[first][0] + around[first][1]) first = i;
    const Pixel &a = around[first], &d = around[(first + 2) % 4];
    Pixel b = around[(first + 1) % 4], c = around[(first + 3) % 4];
    if (b[0] - b[1] < c[0] - c[1]) std::swap(b, c); /* the rows of its points go upwards */
    const double across = std::log(length(a, c) / length(b, d)),
                 down = std::log(length(a, b) / length(c, d));
    if (std::max(std::fabs(across), std::fabs(down)) < SIDES_TILTED) return placed;
    if (std::fabs(across) > std::fabs(down))
        placed.nearer = across > 0 ? Nearer::left : Nearer::right;
    else
        placed.nearer = down > 0 ? Nearer::top : Nearer::bottom;
    return placed;
}

bool Guide::is_new(const View &view) const
{
    return std::all_of(views_.begin(), views_.end(), [&](const View &other) {
        return mean_shift(other, view) >= NEW_SHARE * width_;
    });
}

/* Adds to what is missing; where nothing is, every new picture does. */
bool Guide::is_useful(const View &view) const
{
    const Placed placed = place(view);
    bool missing = false, adds = false;
    for (int part = 0; part < COLUMNS * ROWS; part++)
        missing |= parts_[(size_t)part] < PART_CORNERS && !blind_[(size_t)part];
    for (const Pixel &corner : view.corners) {
        if (!seen(corner)) continue;
        adds |= parts_[(size_t)part_of(corner, width_, height_)] < PART_CORNERS;
    }
    for (int i = 1; i < NEARER_COUNT; i++) {
        missing |= tilts_[(size_t)i] < TILTED;
        adds |= (int)placed.nearer == i && tilts_[(size_t)i] < TILTED;
    }
    missing |= close_ < CLOSE || distant_ < DISTANT;
    adds |= placed.width_share > CLOSE_SHARE && close_ < CLOSE;
    adds |= placed.width_share < DISTANT_SHARE && distant_ < DISTANT;
    return adds || !missing;
}

Advice Guide::look(const View &view)
{
    Advice advice;
    const bool still = !live_ || mean_shift(before_, view) < STILL_PX;
    before_ = view;
    std::vector<double> edges;
    for (const View &other : views_)
        edges.push_back(other.edge_px);
    const double usual = median(edges);
    advice.text = instruction();
    if (done()) return advice;
    if (!view.left_out.empty() || view.corners.empty())
        advice.trouble = "no board in the picture";
    else if (view.edge_px > EDGE_MAX_PX || (usual > 0 && view.edge_px > EDGE_FACTOR * usual))
        advice.trouble = "blurred: hold the board still, add light, focus";
    else if (!still)
        advice.trouble = "hold the board still";
    else if (!is_new(view) || (!is_useful(view) && refused_ < TAKE_ANY)) {
        advice.trouble = "such a picture was taken";
        if (++refused_ % ASK_ANOTHER == 0) choose_wanted();
    } else
        advice.take = true;
    return advice;
}

void Guide::add(const View &view)
{
    const Placed placed = place(view);
    views_.push_back(view);
    refused_ = 0;
    for (const Pixel &corner : view.corners)
        if (seen(corner)) parts_[(size_t)part_of(corner, width_, height_)]++;
    tilts_[(size_t)placed.nearer]++;
    close_ += placed.width_share > CLOSE_SHARE;
    distant_ += placed.width_share < DISTANT_SHARE;
    /* Solving takes longer the more there are. */
    const int count = (int)views_.size();
    if (count >= SOLVE_FROM && (count < 16 || count % 2 == 0)) solve_again();
    choose_wanted();
}

void Guide::solve_again()
{
    Solution best;
    bool any = false;
    for (const Model model : models_) {
        SolveOptions options;
        std::string error;
        Solution solution;
        options.model = model;
        if (!solve(board_, views_, width_, height_, options, solution, error)) continue;
        if (!any || solution.rms_px < best.rms_px) best = solution;
        any = true;
        if (best.rms_px < MODEL_DOUBTED_PX) break;
    }
    if (!any) return;
    const Verdict verdict = judge(views_, best, best.rms_px);
    focal_deviation_ = std::max(best.stdev[0] / best.camera.fx, best.stdev[1] / best.camera.fy);
    projection_px_ = verdict.uncertainty_seen_px;
    fovea_camera camera = best.camera;
    const bool prepared = fovea_camera_prepare(&camera, nullptr) == FOVEA_OK;
    for (int part = 0; part < COLUMNS * ROWS; part++) {
        const double centre[2] = {(part % COLUMNS + .5) * width_ / COLUMNS - .5,
                                  (part / COLUMNS + .5) * height_ / ROWS - .5}; // NOLINT
        double bearing[3];
        blind_[(size_t)part] =
            prepared && fovea_camera_unproject(&camera, centre, bearing, nullptr) != FOVEA_OK;
    }
    int empty = 0;
    for (int part = 0; part < COLUMNS * ROWS; part++)
        empty += parts_[(size_t)part] < PART_CORNERS_MIN && !blind_[(size_t)part];
    certain_ = (int)views_.size() >= VIEWS_MIN && empty <= EMPTY_MAX &&
               verdict.grade == Grade::pass && focal_deviation_ < FOCAL_CERTAIN &&
               projection_px_ < PROJECTION_CERTAIN_PX;
}

/* The emptiest part, the rarest tilt, and now and then from further away. */
void Guide::choose_wanted()
{
    /* Corners of the image first: they need the board at its border. */
    static constexpr int order[COLUMNS * ROWS] = {0, 8, 2, 6, 3, 5, 1, 7, 4};
    int part = 4;
    if (!views_.empty()) {
        part = -1;
        for (const int candidate : order)
            if (!blind_[(size_t)candidate] &&
                (part < 0 || parts_[(size_t)candidate] < parts_[(size_t)part]))
                part = candidate;
        if (part < 0) part = 4;
        /* It seems that the board cannot be held there. */
        for (int n = 0; n < refused_ / ASK_ANOTHER; n++)
            part = (part + 2) % (COLUMNS * ROWS);
    }
    int rarest = 1;
    for (int i = 2; i < NEARER_COUNT; i++)
        if (tilts_[(size_t)i] < tilts_[(size_t)rarest]) rarest = i;
    wanted_.column = part % COLUMNS;
    wanted_.row = part / COLUMNS;
    wanted_.nearer = (Nearer)rarest;
    wanted_.close = distant_ >= DISTANT || views_.size() % 4 != 3;
}

std::string Guide::instruction() const
{
    static const char *const rows[ROWS] = {"top", "middle", "bottom"};
    static const char *const columns[COLUMNS] = {"left", "middle", "right"};
    static const char *const sides[NEARER_COUNT] = {"", "left", "right", "upper", "lower"};
    if (certain_) return "enough: the camera is certain";
    if (done()) return "enough pictures";
    const bool centre = wanted_.row == 1 && wanted_.column == 1;
    std::string text = "board to the ";
    if (centre)
        text += "middle";
    else
        text += std::string(wanted_.row == 1 ? "" : rows[wanted_.row]) +
                (wanted_.row != 1 && wanted_.column != 1 ? " " : "") +
                (wanted_.column == 1 ? "" : columns[wanted_.column]);
    text += centre ? " of the picture, its " : " of the picture as far as all of it is seen, its ";
    text += sides[(int)wanted_.nearer];
    text += " side nearer to the camera (some 40 degrees), ";
    text += wanted_.close ? "close: two thirds of the picture's width"
                          : "further away: a quarter of the "
                            "picture's width";
    return text;
}

} // namespace calibrate
