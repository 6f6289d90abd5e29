#include "bench/bench.h"

#include <cstdio>
#include <fstream>
#include <sstream>

namespace bench
{

static std::string quoted(const std::string &text)
{
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        if (static_cast<unsigned char>(c) >= 0x20) out += c;
    }
    return out + "\"";
}

static std::string number(double value, const char *format)
{
    char text[64];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

bool write_json(const std::string &path, const Facts &facts, const std::vector<Result> &results)
{
    std::ofstream out(path);
    out << "{\n  \"machine\": " << quoted(facts.machine)
        << ",\n  \"compiler\": " << quoted(facts.compiler)
        << ",\n  \"flags\": " << quoted(facts.flags) << ",\n  \"commit\": " << quoted(facts.commit)
        << ",\n  \"opencv\": " << quoted(facts.opencv) << ",\n  \"image\": " << quoted(facts.image)
        << ",\n  \"results\": [";
    const char *comma = "\n";
    for (const Result &r : results) {
        out << comma << "    {\"name\": " << quoted(r.name) << ", \"size\": " << quoted(r.size)
            << ", \"isa\": " << quoted(r.isa) << ", \"ours_us\": " << number(r.ours_us, "%.3f");
        if (r.peer.empty())
            out << ", \"peer\": null, \"peer_us\": null, \"ratio\": null}";
        else
            out << ", \"peer\": " << quoted(r.peer)
                << ", \"peer_us\": " << number(r.peer_us, "%.3f")
                << ", \"ratio\": " << number(r.ours_us / r.peer_us, "%.4f") << "}";
        comma = ",\n";
    }
    out << "\n  ]\n}\n";
    out.close();
    if (!out) std::printf("%s: cannot be written\n", path.c_str());
    return static_cast<bool>(out);
}

/* One line per row: all its variants, best set first for stages. */
static std::string table_row(const std::vector<const Result *> &row)
{
    const Result *best = row[0], *base = nullptr, *c = nullptr;
    for (const Result *r : row) {
        if (r->ours_us < best->ours_us) best = r;
        if (r->isa == "sse4" || r->isa == "neon") base = r;
        if (r->isa == "c") c = r;
    }
    std::ostringstream out;
    const bool peer = !best->peer.empty() && best->peer != "plain C";
    out << "| " << best->name << " | " << best->size << " | " << (peer ? best->peer : "–") << " | "
        << (peer ? number(best->peer_us, "%.0f") : "–") << " | " << number(best->ours_us, "%.1f")
        << " (" << best->isa << ") | "
        << (peer ? number(best->ours_us / best->peer_us, "%.3f") : "–") << " | "
        << (base != nullptr ? number(base->ours_us, "%.1f") : "–") << " | "
        << (c != nullptr ? number(c->ours_us, "%.0f") : "–") << " |\n";
    return out.str();
}

/* What a frame costs on ARM is counted under an emulator and kept in the kernels' page
 * (tools/arm_report.sh).
 */
static std::string arm_line()
{
    const std::string page = "src/kernels/ARM.md", start = "| frame of the whole program";
    std::ifstream in(page);
    for (std::string line; std::getline(in, line);) {
        if (line.rfind(start, 0) != 0) continue;
        std::vector<std::string> cells;
        std::istringstream row(line.substr(2));
        for (std::string cell; std::getline(row, cell, '|');)
            cells.push_back(cell.substr(0, cell.find_last_not_of(' ') + 1));
        if (cells.size() < 3) break;
        return "\nOn aarch64, counted instructions of a " + cells[0] + ":" + cells[2] +
               ", in plain C" + cells[1] + " ([" + page + "](../" + page + ")).\n";
    }
    return "";
}

static std::string table(const Facts &facts, const std::vector<Result> &results, bool kernels)
{
    std::ostringstream out;
    out << "Medians of thread-CPU time in microseconds, one thread, samples interleaved with OpenCV "
        << facts.opencv << " in one process. Machine: " << facts.machine
        << "; compiler: " << facts.compiler << "; flags: " << facts.flags
        << "; commit: " << facts.commit << "; image: " << facts.image << ".\n\n"
        << "| what | size | OpenCV's | OpenCV | Fovea (set) | ratio | sse4 / neon | plain C |\n"
        << "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: |\n";
    for (size_t i = 0; i < results.size();) {
        std::vector<const Result *> row;
        const std::string name = results[i].name;
        for (; i < results.size() && results[i].name == name; i++)
            row.push_back(&results[i]);
        if (row[0]->kernel == kernels) out << table_row(row);
    }
    if (!kernels) out << arm_line();
    return out.str();
}

bool write_page(const std::string &path, const Facts &facts, const std::vector<Result> &results,
                bool kernels)
{
    const std::string begin = "<!-- bench:begin (written by make bench) -->\n",
                      end = "<!-- bench:end -->";
    std::ifstream in(path);
    std::stringstream whole;
    whole << in.rdbuf();
    std::string text = whole.str();
    const size_t from = text.find(begin), to = text.find(end);
    if (!in || from == std::string::npos || to == std::string::npos || to < from) {
        std::printf("%s: no table written, the markers '%s' and '%s' are not there\n", path.c_str(),
                    begin.substr(0, begin.size() - 1).c_str(), end.c_str());
        return true;
    }
    text.replace(from + begin.size(), to - from - begin.size(), table(facts, results, kernels));
    std::ofstream out(path);
    out << text;
    out.close();
    if (!out) std::printf("%s: cannot be written\n", path.c_str());
    return static_cast<bool>(out);
}

} // namespace bench
