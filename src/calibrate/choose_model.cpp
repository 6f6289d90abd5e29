#include "calibrate/choose_model.h"

#include "calibrate/compare.h"

extern "C" {
#include "support/say.h"
}

namespace calibrate
{
namespace
{

constexpr int FOLDS = 5;
/* A model with more coefficients must be better by this in pictures held out. */
constexpr double BETTER = .95;

/* Solve by each model and keep the one with the least error in pictures held out; the first of them
 * where the gain is small. False: none could be solved. */
bool choose_model(const std::vector<Model> &models, int width, int height, SolveOptions options,
                  Report &report, std::string &error)
{
    bool any = false;
    for (const Model model : models) {
        options.model = model;
        Solution solution;
        std::string why;
        if (fv_say_terminal()) fv_say_status("solving: %s", model_name(model));
        const bool solved =
            solve(report.board, report.views, width, height, options, solution, why);
        const double held_out =
            solved ? held_out_rms_px(report.board, report.views, solution, FOLDS, options) : -1;
        report.compared.push_back({model, solved, solution.rms_px, held_out});
        if (!solved && error.empty()) error = why;
        const bool better =
            held_out >= 0 && (report.held_out_px < 0 || held_out < BETTER * report.held_out_px);
        if (!solved || (any && !better)) continue;
        any = true;
        report.solution = solution;
        report.held_out_px = held_out;
    }
    if (fv_say_terminal()) fv_say_status("%s", "");
    return any;
}

} // namespace

void solve_and_judge(const Collection &collection, const std::vector<Model> &models,
                     const SolveOptions &options, Report &report)
{
    const int width = collection.width, height = collection.height;
    report.views = collection.views;
    leave_out_blurred(report.views);
    std::string error;
    if (!choose_model(models, width, height, options, report, error)) {
        report.verdict = judge_unsolved(report.views, error);
        return;
    }
    report.verdict = judge(report.views, report.solution, report.held_out_px);
    const Halves halves = compare_halves(report.board, report.views, report.solution, options);
    report.cross_solve_px = halves.difference_px;
    judge_halves(halves, report.verdict);
    if (options.bend) return;
    SolveOptions bent = options;
    Solution solution;
    bent.bend = true;
    bent.model = report.solution.model;
    if (solve(report.board, report.views, width, height, bent, solution, error))
        judge_bend(report.board, report.solution, solution, report.verdict);
}

} // namespace calibrate
