/* fovea-calibrate target and convert: boards to print, and camera files of other programs. */
#include <cstdio>

#include "calibrate/command.h"
#include "calibrate/page.h"
#include "calibrate/pictures.h"
#include "calibrate/text_file.h"
#include "calibrate/verdict.h"
#include "support/calibration.h"
extern "C" {
#include "support/say.h"
}

namespace calibrate
{
namespace
{

/* "ros, opencv or kalibr". */
std::string format_list()
{
    std::string list;
    for (int i = 0; i < FV_CALIBRATION_FORMAT_COUNT; i++)
        list += std::string(i == 0                                ? ""
                            : i + 1 < FV_CALIBRATION_FORMAT_COUNT ? ", "
                                                                  : " or ") +
                fv_calibration_format_name((fv_calibration_format)i);
    return list;
}

bool format_of(const std::string &name, fv_calibration_format &format)
{
    for (int i = 0; i < FV_CALIBRATION_FORMAT_COUNT; i++) {
        format = (fv_calibration_format)i;
        if (name == fv_calibration_format_name(format)) return true;
    }
    return false;
}

} // namespace

int read_camera(const std::string &file, int width, int height, fovea_camera &camera)
{
    fv_calibration calibration;
    fovea_error error;
    if (fv_calibration_read(file.c_str(), nullptr, &calibration, &error) != FOVEA_OK ||
        fv_calibration_fit(&calibration.camera, width, height, false, file.c_str(), &error) !=
            FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    camera = calibration.camera;
    return FV_EXIT_OK;
}

int collect_known(const std::string &source, const std::string &file, const Board &board,
                  int views_max, Collection &collection, fovea_camera &camera)
{
    fovea_error error;
    fv_calibration calibration; /* a wrong file is named before pictures are searched */
    if (fv_calibration_read(file.c_str(), nullptr, &calibration, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    if (collect(source, board, Refinement::OWN, views_max, collection, &error,
                size_of(calibration.camera, file)) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    if (collection.width == 0)
        return fv_say_wrong("%s: found no board in its pictures, expected %s", source.c_str(),
                            board.text().c_str());
    leave_out_blurred(collection.views);
    return read_camera(file, collection.width, collection.height, camera);
}

int command_target(int argc, char **argv)
{
    std::string target, page = "a4", out;
    const std::vector<Option> options = {
        {"target", "BOARD", &target, "board, as chessboard:9x6:0.025; see --man for the others"},
        {"page", "PAGE", &page, "a4 (default), letter or a3"},
        {"out", "FILE", &out, "write the PDF there"},
    };
    std::vector<std::string> operands;
    int status;
    if (!options_parse(argc, argv, options, "", 0, operands, &status)) return status;
    Board board;
    std::string pdf, error;
    if (out.empty())
        return fv_say_wrong("fovea-calibrate target: found no --out, expected a file name");
    if (!board_parse(target, board, error) || !page_write(board, page, pdf, error))
        return fv_say_wrong("%s", error.c_str());
    return write_text(out, pdf);
}

int command_convert(int argc, char **argv)
{
    std::string format_name = "ros", which;
    const std::vector<Option> options = {
        {"format", "FORMAT", &format_name,
         "of OUT: ros (default; Fovea's own), ros-message, opencv, kalibr, euroc, orb-slam3, basalt "
         "or photonvision"},
        {"which", "CAMERA", &which, "camera of a file with several, as cam1 (default: the first)"},
    };
    std::vector<std::string> operands;
    int status;
    if (!options_parse(argc, argv, options, "IN OUT", 2, operands, &status)) return status;
    fv_calibration_format format;
    if (!format_of(format_name, format))
        return fv_say_wrong("--format: found '%s', expected %s", format_name.c_str(),
                            format_list().c_str());
    fv_calibration calibration;
    fovea_error error, lost;
    if (fv_calibration_read(operands[0].c_str(), which.empty() ? nullptr : which.c_str(),
                            &calibration, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    char text[FV_CALIBRATION_BYTES_MAX];
    if (fv_calibration_format_text(format, &calibration, text, &lost, &error) != FOVEA_OK)
        return fv_say_wrong("%s: %s", operands[0].c_str(), error.text);
    if (lost.text[0] != '\0') fv_say("%s: lost: %s", operands[1].c_str(), lost.text);
    return write_text(operands[1], text);
}

} // namespace calibrate
