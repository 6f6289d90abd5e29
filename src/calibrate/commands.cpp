/* The table of commands, and their manual pages. */
#include <cstdio>

#include "calibrate/calibrate.h"
#include "calibrate/command.h"
#include "support/man.h"

namespace calibrate
{

const std::vector<Command> commands = {
    {"camera", "calibrate a camera from pictures of a board", command_camera,
     "Boards (chessboards, ChArUco boards, AprilGrids, circles) are found in the pictures of a folder, or in the frames of a camera or recording. "
     "The model of the lens is fitted to their corners, and the verdict - pass, doubtful or fail - "
     "says whether the camera file can be trusted, with the remedy where it cannot. A live camera "
     "or recording says which picture is missing (corners of the image, tilt, distance), takes one by "
     "itself whenever the board is still, sharp and adds to what is missing, and ends when the "
     "focal length and projection are certain, after --views pictures, or by SIGINT. --report writes one HTML file, which needs no network, with errors, "
     "coverage, residual directions, uncertainty of projection and the pictures.",
     "fovea-calibrate camera --source pictures/ --target chessboard:9x6:0.025 --out camera.yaml\n"
     "fovea-calibrate camera --source v4l2:/dev/video0 --target chessboard:9x6:0.025 "
     "--out camera.yaml --report report.html\n"
     "fovea-calibrate camera --source sim:board --target chessboard:9x6:0.03 --report report.html"},
    {"check", "judge a camera file by new pictures of a board", command_check,
     "A camera of the file's model is fitted to the new pictures, and both project the same "
     "directions. The verdict is fail where they differ by more than 3 px in a part of the image "
     "that the pictures know, doubtful from 1 px on or where the pictures do not know enough. Ten "
     "pictures with the board tilted and near all corners of the image are enough.",
     "fovea-calibrate check camera.yaml --source pictures/ --target chessboard:9x6:0.025"},
    {"rig", "place cameras and an inertial sensor to each other from pictures of a board",
     command_rig,
     "All cameras take pictures of one board at the same instants; each board is seen by two or more "
     "of them. Lenses come from --camera files or are estimated from the same pictures, and then "
     "all lenses, the cameras' places and the board's are solved for together. The verdict states "
     "errors of each camera, the distance of corners from the epipolar lines in pictures that the "
     "solve did not see, and standard deviations of each place; those of cameras with a file leave "
     "out what is uncertain in the file. --out is a camchain with T_cn_cnm1, of which Fovea reads "
     "cam1 and on with their place before cam0: 'convert --which cam1' carries it into other "
     "formats. A source with several cameras is sim:board?baseline=0.1, euroc:DIR?cameras=2 or a "
     "recording; of several sources the pictures belong together in their order.\n\n"
     "With --imu, cameras and inertial sensor are moved together before a board that stands still: turn "
     "quickly about all axes, one after the other, for half a minute or more, with the board in the "
     "image. The place of the sensor, the offset of its clock, its biases and gravity are solved for "
     "together with its motion, a spline over time. --out then holds T_cam_imu and timeshift_cam_imu, "
     "as Kalibr's camchain-imucam, and --imu-out is the file for the key imu_file of fovea. A live "
     "camera takes the samples of --imu iio:NAME or lcm:CHANNEL, whose densities --imu-file states.",
     "fovea-calibrate rig --source left/ --source right/ --target chessboard:9x6:0.025 --out rig.yaml\n"
     "fovea-calibrate rig --source left/ --source right/ --camera left.yaml --camera right.yaml "
     "--target aprilgrid:6x6:0.088:0.3 --out rig.yaml --report rig.html\n"
     "fovea-calibrate rig --source 'sim:board?baseline=0.1' --target chessboard:9x6:0.03\n"
     "fovea-calibrate rig --source 'euroc:DIR?imu=1' --imu source --camera camera.yaml --target "
     "aprilgrid:6x6:0.088:0.3 --out camchain-imucam.yaml --imu-out imu.yaml\n"
     "fovea-calibrate rig --source v4l2:/dev/video0 --imu iio:adis16448 --imu-file noise.yaml --camera "
     "camera.yaml --target chessboard:9x6:0.025 --out rig.yaml --imu-out imu.yaml\n"
     "fovea-calibrate rig --source 'sim:board?imu=200&imu_pose=0.05,0,0,0,0,90' --imu source --target "
     "chessboard:9x6:0.03"},
    {"floor", "find the height and tilt of a camera over the floor from a board that lies on it",
     command_floor,
     "The board lies on the floor, and is moved to other places between the pictures. The camera is "
     "mounted as it will be, and known by its file. --out holds the keys T_body_cam, scale.source and "
     "scale.camera_height_m of Fovea's configuration, with a body on the floor right below the "
     "camera: metric scale and objects on the floor read them. Boards that do not lie on the plane "
     "of the others are left out.",
     "fovea-calibrate floor --source pictures/ --camera camera.yaml --target chessboard:9x6:0.025 "
     "--thickness 0.005 --out floor.yaml\nfovea run --config floor.yaml --source v4l2:/dev/video0"},
    {"hand-eye", "place a camera on a robot from its poses and pictures of a board",
     command_hand_eye,
     "The board stands still; the robot takes pictures of it from all sides, turned about two axes or "
     "more. --poses holds poses of the body, one a line: stamp x y z qx qy qz qw (TUM), in seconds and "
     "metres, T_world_body. They are found by the stamps of the pictures: those of a recording, or "
     "names of files as 1305031102.175304.png (seconds) or of 16 digits and more (nanoseconds). "
     "Pictures without stamps and as many poses belong together in their order. With --poses lcm:CHANNEL "
     "the robot sends its poses as bot_core.pose_t (utime in microseconds of UTC) while a live camera "
     "takes the pictures. --out holds the key "
     "T_body_cam of Fovea's configuration. The noise of the poses is estimated too. Motions without "
     "rotation, with rotation about one axis alone, or with half turns alone are refused.",
     "fovea-calibrate hand-eye --source pictures/ --poses poses.txt --camera camera.yaml --target "
     "chessboard:9x6:0.025 --out hand_eye.yaml\n"
     "fovea-calibrate hand-eye --source v4l2:/dev/video0 --poses lcm:ARM_POSE --camera camera.yaml "
     "--target chessboard:9x6:0.025 --out hand_eye.yaml"},
    {"imu", "find the noise of an inertial sensor from a log in which it stands still", command_imu,
     "Noise densities and random walks of gyroscope and accelerometer by the Allan variance (IEEE Std "
     "952-1997), with standard deviations. The sensor stands still, away from people and engines, at "
     "an even temperature; an hour is needed for random walks, three are better. Where no walk shows, "
     "the most that it can be is written. --out is EuRoC's sensor.yaml, which Fovea reads, or Kalibr's "
     "imu.yaml.",
     "fovea-calibrate imu --source mav0/imu0/data.csv --out sensor.yaml --plot allan.png\n"
     "fovea-calibrate imu --source lcmlog:standing.lcm --format kalibr --out imu.yaml"},
    {"target", "write a board to print, as PDF at exact size", command_target,
     "Print at 100 %, and measure the ruler and a square afterwards. A ChArUco board or an AprilGrid "
     "may be partly hidden in pictures, which brings corners to the image's border.",
     "fovea-calibrate target --target chessboard:9x6:0.025 --page a4 --out board.pdf"},
    {"convert", "write a camera file in another format", command_convert,
     "IN is a camera file of any format that Fovea reads; which one it is, is found from its keys. "
     "Lens, resolution, place, rate and time shift are written as OUT's format states them, the "
     "record of the calibration (date, camera, model, errors, standard deviations) in a mapping "
     "'calibration' that other programs ignore. What OUT's format cannot hold is named in a line; "
     "a lens that it cannot hold is refused.",
     "fovea-calibrate convert camera.yaml chain.yaml --format kalibr\n"
     "fovea-calibrate convert camchain.yaml right.yaml --which cam1"},
};

void man_program()
{
    fv_man_begin("fovea-calibrate", nullptr, "calibrate a camera for fovea");
    fv_man_synopsis("fovea-calibrate", nullptr,
                    "COMMAND [OPTION]...\n\nfovea-calibrate --version\n\nfovea-calibrate --man");
    fv_man_section("DESCRIPTION");
    fv_man_text("Makes a camera file from pictures of a board, and says whether the file can be "
                "trusted.");
    fv_man_section("COMMANDS");
    for (const Command &command : commands)
        fv_man_item(command.name, nullptr, command.help);
    fv_man_item("help", nullptr, "list the commands, or the options of the command named after it");
    fv_man_section("OPTIONS");
    fv_man_item("--version", nullptr, "print the version");
    fv_man_item("--help", nullptr, "list the commands; of a command: list its options");
    fv_man_item("--man", nullptr, "print this page; of a command: print its page");
    fv_man_section("BOARDS");
    fv_man_text(board_forms);
    fv_man_section("EXIT STATUS");
    fv_man_item("0", nullptr, "success");
    fv_man_item("1", nullptr, "the verdict is fail, or the machine failed");
    fv_man_item("2", nullptr, "wrong input: one line names what was found and what was expected");
    fv_man_reference("fovea", nullptr, true);
    for (const Command &command : commands)
        fv_man_reference("fovea-calibrate", command.name, false);
    putchar('\n');
}

} // namespace calibrate
