#include "calibrate/allan.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <random>

namespace calibrate
{
namespace
{

constexpr double FLOOR = .4412712003; /* 2 ln 2 / pi */
constexpr size_t SAMPLES_MIN = 100;
constexpr int REPEATS = 16;

/* Overlapping Allan variance at `m` periods, of the running sum. */
AllanPoint variance_at(const std::vector<double> &sum, size_t m, double rate_hz)
{
    const size_t count = sum.size() - 2 * m;
    double squares = 0;
    for (size_t i = 0; i < count; i++) {
        const double difference = sum[i + 2 * m] - 2 * sum[i + m] + sum[i];
        squares += difference * difference;
    }
    const double periods = (double)m, values = (double)(sum.size() - 1);
    /* Of clusters side by side; overlap adds to it, so that the error stated is no smaller. */
    return {periods / rate_hz, squares / (2 * periods * periods * (double)count),
            std::max(1., values / periods - 1)};
}

/* Terms of the variance by which parts are held at zero; the weights by the fit itself. False: one
 * is below zero. */
bool fit_terms(const std::vector<AllanPoint> &points, const std::array<bool, 3> &free,
               Eigen::Vector3d &terms, double &cost)
{
    std::vector<int> which;
    for (int i = 0; i < 3; i++)
        if (free[(size_t)i]) which.push_back(i);
    const auto size = (Eigen::Index)which.size();
    std::vector<double> model;
    for (const AllanPoint &point : points)
        model.push_back(point.variance);
    Eigen::VectorXd found(size);
    Eigen::MatrixXd normal(size, size);
    for (int round = 0; round < 8; round++) {
        Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
        normal.setZero();
        for (size_t p = 0; p < points.size(); p++) {
            const double all[3] = {1 / points[p].tau_s, FLOOR, points[p].tau_s / 3};
            const double weight = points[p].freedom / (2 * model[p] * model[p]);
            Eigen::VectorXd row(size);
            for (Eigen::Index i = 0; i < size; i++)
                row[i] = all[which[(size_t)i]];
            normal += weight * row * row.transpose();
            right += weight * row * points[p].variance;
        }
        found = normal.ldlt().solve(right);
        if (!(found.minCoeff() > 0)) return false;
        for (size_t p = 0; p < points.size(); p++) {
            const double all[3] = {1 / points[p].tau_s, FLOOR, points[p].tau_s / 3};
            model[p] = 0;
            for (Eigen::Index i = 0; i < size; i++)
                model[p] += found[i] * all[which[(size_t)i]];
        }
    }
    terms.setZero();
    for (Eigen::Index i = 0; i < size; i++)
        terms[which[(size_t)i]] = found[i];
    cost = 0;
    for (size_t p = 0; p < points.size(); p++)
        cost += points[p].freedom / 2 * std::pow(points[p].variance / model[p] - 1, 2);
    return true;
}

} // namespace

double AllanFit::variance(double tau_s) const
{
    return white * white / tau_s + FLOOR * floor * floor + walk * walk * tau_s / 3;
}

namespace
{

AllanFit fit_once(const std::vector<double> &values, double rate_hz)
{
    constexpr size_t clusters_min = 8;
    constexpr double better = 4; /* in squares, by which a further term must be */
    AllanFit fit;
    std::vector<double> sum = {0};
    double mean = 0;
    for (const double value : values)
        mean += value / (double)values.size();
    for (const double value : values)
        sum.push_back(sum.back() + value - mean);
    for (size_t m = 1; m * clusters_min <= values.size(); m *= 2)
        fit.points.push_back(variance_at(sum, m, rate_hz));
    double best = INFINITY;
    for (const std::array<bool, 3> &free :
         {std::array{true, false, false}, std::array{true, false, true},
          std::array{true, true, false}, std::array{true, true, true}}) {
        Eigen::Vector3d terms;
        double cost;
        if (!fit_terms(fit.points, free, terms, cost) || cost + better > best) continue;
        best = cost;
        fit.white = std::sqrt(terms[0]);
        fit.floor = std::sqrt(terms[1]);
        fit.walk = std::sqrt(terms[2]);
    }
    return fit;
}

/* White noise and a walk as were found, again; `gauss` has two numbers a value where there is a
 * walk, otherwise one. */
std::vector<double> simulate(const AllanFit &fit, size_t count, double rate_hz,
                             const std::vector<double> &gauss)
{
    std::vector<double> values(count);
    double bias = 0;
    const double *next = gauss.data();
    for (double &value : values) {
        value = bias + fit.white * std::sqrt(rate_hz) * *next++;
        if (fit.walk > 0) bias += fit.walk / std::sqrt(rate_hz) * *next++;
    }
    return values;
}

void draw(std::mt19937_64 &bits, std::vector<double> &gauss)
{
    std::normal_distribution<double> normal;
    for (double &number : gauss)
        number = normal(bits);
}

/* How far the fits of simulated values are off, all of one length. Those with and without a walk
 * share their random numbers, which take longer to draw than to use. */
void simulate_deviations(std::vector<AllanFit> &fits, size_t count, double rate_hz)
{
    std::vector<double> white2(fits.size()), walk2(fits.size());
    for (const bool walks : {false, true}) {
        const auto concerned = [&](const AllanFit &fit) { return (fit.walk > 0) == walks; };
        if (std::none_of(fits.begin(), fits.end(), concerned)) continue;
        std::mt19937_64 bits(1);
        std::vector<double> gauss((walks ? 2 : 1) * count);
        for (int i = 0; i < REPEATS; i++) {
            draw(bits, gauss);
            for (size_t f = 0; f < fits.size(); f++) {
                const AllanFit &fit = fits[f];
                if (!concerned(fit)) continue;
                const AllanFit again = fit_once(simulate(fit, count, rate_hz, gauss), rate_hz);
                white2[f] += (again.white - fit.white) * (again.white - fit.white) / REPEATS;
                walk2[f] += (again.walk - fit.walk) * (again.walk - fit.walk) / REPEATS;
            }
        }
    }
    for (size_t f = 0; f < fits.size(); f++) {
        fits[f].white_stdev = std::sqrt(white2[f]);
        fits[f].walk_stdev = fits[f].walk > 0 ? std::sqrt(walk2[f]) : 0;
    }
}

/* What the longest time would have shown: two deviations of its variance. */
void bound_walk(AllanFit &fit)
{
    const AllanPoint &last = fit.points.back();
    const double room = fit.variance(last.tau_s) * (1 + 2 * std::sqrt(2 / last.freedom));
    fit.walk_most = fit.walk > 0 ? fit.walk + 2 * fit.walk_stdev : std::sqrt(3 * room / last.tau_s);
}

/* Of axes of one length, `rate_hz` values a second. */
std::vector<AllanFit> fit_allan(const std::vector<std::vector<double>> &axes, double rate_hz)
{
    std::vector<AllanFit> fits;
    for (const std::vector<double> &values : axes)
        fits.push_back(fit_once(values, rate_hz));
    simulate_deviations(fits, axes[0].size(), rate_hz);
    for (AllanFit &fit : fits)
        bound_walk(fit);
    return fits;
}

/* Where the noise within a second is much more than in others, or the mean moves; negative:
 * nowhere.
 */
double moved_at(const std::vector<std::vector<double>> &axes, double rate_hz)
{
    constexpr double ratio = 6;
    constexpr double rate_most = .05, force_most = .3; /* rad/s, m/s^2: of a second's mean */
    const auto window = (size_t)std::max(2., rate_hz);
    double worst = 1, at_s = -1;
    for (size_t a = 0; a < axes.size(); a++) {
        const std::vector<double> &values = axes[a];
        std::vector<double> spreads, means;
        for (size_t begin = 0; begin + window <= values.size(); begin += window) {
            double mean = 0, squares = 0;
            for (size_t i = begin; i < begin + window; i++)
                mean += values[i] / (double)window;
            for (size_t i = begin; i < begin + window; i++)
                squares += (values[i] - mean) * (values[i] - mean) / (double)window;
            spreads.push_back(squares);
            means.push_back(mean);
        }
        if (spreads.empty()) continue;
        const double usual = median(spreads), still = median(means);
        for (size_t w = 0; w < spreads.size(); w++) {
            const double more = usual > 0 ? spreads[w] / (ratio * ratio * usual) : 0;
            const double off = (means[w] - still) / (a < 3 ? rate_most : force_most);
            if (std::max(more, off * off) <= worst) continue;
            worst = std::max(more, off * off);
            at_s = (double)(w * window) / rate_hz;
        }
    }
    return at_s;
}

void combine(ImuNoise &noise)
{
    for (size_t part = 0; part < IMU_PARTS; part++) {
        double white2 = 0, white_error2 = 0, walk2 = 0, walk_error2 = 0, most2 = 0;
        for (size_t i = 3 * part; i < 3 * part + 3; i++) {
            const AllanFit &axis = noise.axes[i];
            white2 += axis.white * axis.white / 3;
            white_error2 += std::pow(axis.white * axis.white_stdev / 3, 2);
            walk2 += axis.walk * axis.walk / 3;
            walk_error2 += std::pow(axis.walk * axis.walk_stdev / 3, 2);
            most2 += axis.walk_most * axis.walk_most / 3;
        }
        noise.white[part] = std::sqrt(white2);
        noise.white_stdev[part] = std::sqrt(white_error2) / std::max(noise.white[part], 1e-300);
        noise.walk[part] = std::sqrt(walk2);
        noise.walk_stdev[part] =
            noise.walk[part] > 0 ? std::sqrt(walk_error2) / noise.walk[part] : 0;
        noise.walk_most[part] = std::sqrt(most2);
    }
}

} // namespace

bool measure_imu(const std::vector<fovea_imu_sample> &samples, ImuNoise &noise, std::string &error)
{
    noise = ImuNoise();
    noise.samples = samples.size();
    if (samples.size() >= 2)
        noise.duration_s = (double)(samples.back().stamp_ns - samples.front().stamp_ns) * 1e-9;
    if (samples.size() < SAMPLES_MIN || !(noise.duration_s > 0)) {
        error = "found " + std::to_string(samples.size()) +
                " samples of an inertial sensor, expected " + std::to_string(SAMPLES_MIN) +
                " or more";
        return false;
    }
    noise.rate_hz = (double)(samples.size() - 1) / noise.duration_s;
    std::vector<std::vector<double>> axes(6);
    double force2 = 0;
    for (size_t i = 0; i < samples.size(); i++) {
        for (size_t a = 0; a < 3; a++) {
            axes[a].push_back(samples[i].gyro[a]);
            axes[a + 3].push_back(samples[i].acceleration[a]);
        }
        noise.gaps +=
            i > 0 &&
            (double)(samples[i].stamp_ns - samples[i - 1].stamp_ns) * 1e-9 * noise.rate_hz > 1.5;
    }
    const std::vector<AllanFit> fits = fit_allan(axes, noise.rate_hz);
    for (size_t a = 0; a < 6; a++) {
        noise.axes[a] = fits[a];
        double mean = 0;
        for (const double value : axes[a])
            mean += value / (double)samples.size();
        force2 += a >= 3 ? mean * mean : 0;
    }
    noise.specific_force = std::sqrt(force2);
    noise.moved_at_s = moved_at(axes, noise.rate_hz);
    combine(noise);
    return true;
}

Verdict judge_imu(const ImuNoise &noise)
{
    constexpr double duration_pass_s = 3600, duration_doubtful_s = 60;
    constexpr double white_pass = .03, white_doubtful = .2, walk_pass = .3;
    constexpr double force_low = 9.3, force_high = 10.3, gaps_pass = .001;
    static const char *const names[] = {"gyroscope", "accelerometer"};
    Verdict verdict;
    Grade grade = grade_of(-noise.duration_s, -duration_pass_s, -duration_doubtful_s);
    if (grade != Grade::pass)
        add_reason(verdict, grade,
                   "the log is %.1f s long, too short for random walks: expected an hour or more, "
                   "three are better, the sensor standing still at an even temperature",
                   noise.duration_s);
    for (size_t part = 0; part < IMU_PARTS; part++) {
        bool silent = false;
        for (size_t i = 3 * part; i < 3 * part + 3; i++)
            silent |= !(noise.axes[i].white > 1e-12);
        if (silent) {
            add_reason(verdict, Grade::fail,
                       "%s: found an axis whose values never change, expected noise in all three",
                       names[part]);
            continue;
        }
        const double white = noise.white_stdev[part] / noise.white[part];
        grade = grade_of(white, white_pass, white_doubtful);
        if (!(white <= white_pass))
            add_reason(verdict, grade,
                       "%s: the noise density is known to %.1f %%, expected %.0f or better: record "
                       "for longer",
                       names[part], 100 * white, 100 * white_pass);
        if (!(noise.walk[part] > 0))
            add_reason(verdict, Grade::doubtful,
                       "%s: no random walk shows in %.0f s; %.2g at most is written: record for "
                       "longer",
                       names[part], noise.duration_s, noise.walk_most[part]);
        else if (noise.walk_stdev[part] > walk_pass * noise.walk[part])
            add_reason(
                verdict, Grade::doubtful,
                "%s: the random walk is known to %.0f %%, expected %.0f or better: record for "
                "longer",
                names[part], 100 * noise.walk_stdev[part] / noise.walk[part], 100 * walk_pass);
    }
    if (noise.moved_at_s >= 0)
        add_reason(
            verdict, Grade::fail,
            "the sensor moved, most at %.0f s of the log: let it stand, away from people and "
            "engines",
            noise.moved_at_s);
    if (noise.specific_force < force_low || noise.specific_force > force_high)
        add_reason(
            verdict, Grade::doubtful,
            "the mean acceleration is %.2f m/s^2, expected gravity, about 9.8: samples are not "
            "in m/s^2, or the sensor is not calibrated",
            noise.specific_force);
    if ((double)noise.gaps > gaps_pass * (double)noise.samples)
        add_reason(verdict, Grade::doubtful,
                   "%zu of %zu samples come late: some are lost; record on an idle machine",
                   noise.gaps, noise.samples);
    return verdict;
}

} // namespace calibrate
