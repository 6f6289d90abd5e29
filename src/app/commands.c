/* The table of commands: the only place that knows them all. */
#include "app/command.h"

#include <stddef.h>

#include "app/config/commands.h"
#include "app/lab/commands.h"
#include "app/run/commands.h"
#include "app/watch/commands.h"

const struct fv_command fv_commands[] = {
    {"run", "run the loop on a camera, a recording or the simulated camera", fv_command_run,
     "Frames of the source are processed by the runtime, and messages are sent by LCM after each. "
     "Cameras run in real time: late frames are dropped and long work is cut to what is left of the "
     "frame period. Recordings and the simulated camera run as fast as the machine allows, with "
     "every frame, and give the same results on every machine. The run ends with the source, after "
     "--frames, or on SIGINT and SIGTERM; then a summary is printed and a picture is drawn.",
     "fovea run --source sim:orbit\n"
     "fovea run --source v4l2:/dev/video0 --camera camera.yaml --record box/\n"
     "fovea run --source kitti:DIR --trajectory live.tum --trajectory-final final.tum"},
    {"check", "check whether a configuration will run on this machine, and its memory",
     fv_command_check,
     "Each line names a part - memory, kernels, real-time rights, LCM, camera, calibration, model - "
     "and says that it is ok, or what is missing and what remedies it.",
     "fovea check --config robot.yaml\nfovea check --source v4l2:/dev/video0 --bench"},
    {"cameras", "list the cameras of this host, with a URI ready for each", fv_command_cameras,
     "Each camera of V4L2 and of libcamera is printed with the name under which it is found again "
     "when others come and go, its formats with sizes and rates, its controls with their ranges, "
     "and a URI for --source: the size nearest to 640 x 480 at 25 Hz or more. Formats that Fovea "
     "does not read are marked. No camera is set up; a camera may be in use.",
     "fovea cameras\nfovea cameras --json"},
    {"config", "print the commented configuration, or check a file", fv_command_config,
     "Without options every key is printed as YAML with its meaning, range, unit and default. Any "
     "key may be left out of a file.",
     "fovea config >robot.yaml\nfovea config --check robot.yaml"},
    {"replay", "run a recording again and compare every message", fv_command_replay,
     "FILE was written by 'fovea run --record'. The runtime gets the recorded frames, samples, "
     "commands and grants again, and makes the same messages on every machine.",
     "fovea replay run.lcm --verify\nfovea replay run.lcm --lcm-url udpm://239.255.76.67:7667"},
    {"compare", "say where two runs on the same inputs became different", fv_command_compare,
     "A and B are recordings of 'fovea run --record', or with --live the channel prefixes of two "
     "runs that are heard. The first iteration that differs is named, with its frame: what of the "
     "inputs, where those differ, else the first stage whose features or state differ, and the "
     "first message with the field and both values. Stages are known of runs with lockstep_every: "
     "1, which then send hashes of all of their state. Clock readings, resident memory and "
     "temperature are left out. The exit status is 0 where nothing differs, 1 where something "
     "does, where a recording is cut off or ends before the other, or where not all could be "
     "compared, and 2 where a file is no recording or is damaged.",
     "fovea compare board1.lcm board2.lcm\nfovea compare --live LEFT RIGHT --iterations 500"},
    {"echo", "print the messages of running robots as JSON", fv_command_echo,
     "CHANNEL is the name of a channel, or a pattern in which * stands for any letters and ? for "
     "one. One line is printed for each message of one packet, which all of Fovea's are: channel, "
     "time of arrival in microseconds since 1970, whether it is from this host, bytes, and the "
     "message with its fields; null and the problem for what is no message of Fovea. Messages are "
     "checked from end to end before they are printed. Ends on SIGINT and SIGTERM too.",
     "fovea echo FOVEA_POSE\nfovea echo '*_STATISTICS' --count 1 --timeout 5\n"
     "fovea echo '*' --listen loopback >messages.json"},
    {"top", "watch running robots: state, rates, times, deadlines", fv_command_top,
     "A full screen shows each robot whose messages are heard, by channel prefix; PREFIX may be a "
     "pattern with * and ?. FOR s is how long the state has lasted; MEAN and MAX ms are times of "
     "the loop's stages per frame, LATENCY is from the stamp to the step, LATE are frames that were "
     "dropped because the loop was busy: missed deadlines. A line below has the mean time of each "
     "stage. A robot that says nothing for 3 seconds is silent, and forgotten after a minute. The "
     "size follows the terminal's; q ends.",
     "fovea top\nfovea top LEFT --interval 1\nfovea top --once\n"
     "fovea top --once --json | jq -r 'select(.late > 0).prefix'"},
    {"snapshot", "write what a running robot sees to a file", fv_command_snapshot,
     "FILE gets the next preview that is heard, the newest picture that the robot sends: as it was "
     "sent where the name ends in .jpg, decoded where it ends in .png. It replaces an earlier file "
     "when it is whole, and only then. Its size is that of the preview, not of the camera's image. "
     "With --feed and a name in .png it is a frame as the camera gave it.",
     "fovea snapshot now.jpg\nfovea snapshot left.png --prefix LEFT --timeout 30\n"
     "fovea snapshot now.png --feed /run/fovea/front.sock"},
    {"features", "find, describe and draw the features of a picture", fv_command_features,
     "IMAGE is a PNG, JPEG or BMP file.",
     "fovea features photo.png --draw out.png\n"
     "fovea features photo.png --method sift --max 500 --draw out.png --json >out.json"},
    {"match", "match the features of two pictures", fv_command_match,
     "A and B are PNG, JPEG or BMP files.",
     "fovea match a.png b.png --draw matches.png\n"
     "fovea match a.png b.png --method sift --geometry homography --json >out.json"},
    {"rectify", "remove the lens distortion of a picture", fv_command_rectify,
     "IN is a PNG, JPEG or BMP file; OUT is written as PNG.",
     "fovea rectify --camera camera.yaml in.png out.png --write-camera out.yaml"},
    {"image", "run a chain of image operations on a picture", fv_command_image,
     "IN is a PNG, JPEG or BMP file; OUT is written as PNG, in grey levels, or in colours "
     "where white_balance is among the operations: the others change their brightness then.",
     "fovea image in.png out.png --operations denoise,sharpen\n"
     "fovea image in.png out.png --operations contrast_enhancement --limit 3\n"
     "fovea image in.jpg out.png --operations white_balance,denoise"},
    {"edges", "find the edges of a picture", fv_command_edges,
     "IN is a PNG, JPEG or BMP file; OUT is written as PNG, with edges white.",
     "fovea edges in.png out.png --method canny --low 50 --high 150\n"
     "fovea edges in.png out.png --method scharr --high 800"},
    {"segments", "find the line segments of a picture", fv_command_segments,
     "IN is a PNG, JPEG or BMP file; OUT is written as PNG, with the segments over the darkened picture.",
     "fovea segments in.png out.png --min-length 20\nfovea segments in.png out.png --json >out.json"},
    {"detect", "run an int8 network on pictures: boxes, keypoints, classes, masks",
     fv_command_detect, "One line of JSON is printed for each picture.",
     "fovea detect --model src/detect/shipped.fvm photo.png --draw boxes"},
    {"segment", "find the class of each pixel of pictures, judge a network by labels",
     fv_command_segment,
     "One line of JSON is printed for each picture: the classes with their share of the mask, their "
     "mean confidence where the network gives it, and their colours. --evaluate prints the confusion "
     "matrix (rows are labels, columns what the network sees) and the intersection over union of each "
     "class; pixels that the map ignores do not count.",
     "fovea segment --model src/detect/segmenter.fvm photo.png --draw out.png --mask classes.png\n"
     "fovea segment --model city.fvm pictures/*.png --evaluate labels --classes-map map.txt"},
    {"model", "print what a model file holds and its speed, write its raw outputs",
     fv_command_model,
     "FILE is a network made by tools/import. info prints what it holds and needs, and its speed here. "
     "run writes its raw outputs for pictures, or for .npy arrays of the inputs' types and shapes: "
     "output0 and so on, whose first axis is the run.",
     "fovea model info src/detect/shipped.fvm\nfovea model run mine.fvm photo.png --out outputs.npz"},
    {"export", "write the frames of a source, and their truth, as files", fv_command_export,
     "DIR gets one PNG per frame and, where the source knows the truth, COCO annotations. With "
     "--masks it also gets NAME.mask.png, whose grey levels are classes: 0 background (ceilings, the "
     "sky), 1 ball, 2 cone, 3 box, 4 person, 5 floor, 6 wall, 7 obstacle (furniture and whatever "
     "else stands or hangs), 8 pit (the inside of a hole in the floor); and classes-map.txt, which "
     "says for 'fovea segment --evaluate DIR --classes-map DIR/classes-map.txt' what each of them "
     "is: floor, wall, obstacle (7, 8), movable (1 to 4) or other (0).",
     "fovea export --source sim: --frames 100 frames\nfovea export --masks --source sim:wander --frames 100 labelled"},
    {"map", "print what a saved map holds, export it, draw it", fv_command_map,
     "FILE was written by 'fovea run --save-map'. info prints its keyframes, landmarks and camera; "
     "export writes files; draw writes a picture of it from above and from the side.",
     "fovea map info a.map\nfovea map export a.map --ply a.ply\nfovea map draw a.map a.png"},
    {NULL, NULL, NULL, NULL, NULL},
};
