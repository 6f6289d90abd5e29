import bot_core.pose_t;
import fovea.camera_status_t;
import fovea.detection_t;
import fovea.detections_t;
import fovea.features_t;
import fovea.map_t;
import fovea.objects_t;
import fovea.preview_t;
import fovea.run_t;
import fovea.statistics_t;
import java.io.IOException;
import java.util.Locale;
import java.util.Map;
import java.util.TreeMap;
import java.util.regex.Pattern;
import lcm.lcm.LCM;
import lcm.lcm.MessageAggregator;

/**
 * Listen to Fovea's messages in Java: print each, and at the end how many came on each channel and whether any is missing.
 *
 * <pre>
 *     make jar
 *     java -cp build/fovea-types.jar:/usr/share/java/lcm.jar tools/subscribers/Subscribe.java [--url URL] [--prefix FOVEA]
 *         [--idle SECONDS] [--quiet]
 * </pre>
 *
 * Debian's packages default-jdk-headless and liblcm-java are all that it needs. LCM's Java reads the socket in a thread of its
 * own, and gives the socket the room that the kernel gives by default (net.core.rmem_default, often 208 KiB); a
 * MessageAggregator takes the messages from there at once, so that printing holds up nothing.
 */
public final class Subscribe {
    /** What came on one channel. Gaps are counted by the frame number. */
    private static final class Channel {
        long messages, bytes, gaps, malformed, first = -1, last = -1;

        void count(byte[] data, long sequence) {
            if (messages == 0) first = sequence;
            else if (sequence > last + 1) gaps += sequence - last - 1;
            last = sequence;
            messages++;
            bytes += data.length;
        }
    }

    private static final String[] STATES = {"starting", "tracking", "weak", "lost", "paused", "coasting"};
    private static final String[] SCALES = {"free", "initialising", "metric"};

    private final String prefix;
    private final boolean quiet;
    private final Map<String, Channel> channels = new TreeMap<>();
    private long runId;

    private Subscribe(String prefix, boolean quiet) {
        this.prefix = prefix;
        this.quiet = quiet;
    }

    /* ---- one line about a message -------------------------------------------------------------------------------------- */

    private static String nameOf(String[] names, int value) {
        return value >= 0 && value < names.length ? names[value] : "unknown";
    }

    private static String about(fovea.pose_t m) {
        return String.format(Locale.ROOT, "%s, %s in %s: position %.3f %.3f %.3f %s, scale %s, quality %.2f, %d inliers",
                nameOf(STATES, m.state), m.child_frame, m.parent_frame, m.position[0], m.position[1], m.position[2],
                m.scale_state == fovea.pose_t.SCALE_METRIC ? "m" : "units", nameOf(SCALES, m.scale_state), m.quality, m.inliers);
    }

    private static String about(detections_t m) {
        StringBuilder text = new StringBuilder(m.count + " objects found by " + m.model);
        for (detection_t found : m.detections) text.append(String.format(Locale.ROOT, ", %s with %.2f", found.class_name, found.score));
        return text.toString();
    }

    private static String about(run_t m) {
        return String.format("run %016x of process %d on %s, Fovea %s", m.run_id, m.process, m.host, m.version);
    }

    /* ---- messages ------------------------------------------------------------------------------------------------------ */

    private void frame(Channel channel, String name, byte[] data, fovea.stamp_t stamp, String text) {
        channel.count(data, stamp.sequence);
        if (!quiet) System.out.printf(Locale.ROOT, "%s: frame %d at %.6f s: %s%n", name, stamp.sequence, stamp.time_ns * 1e-9, text);
    }

    /** Who sends: printed when it changes, which is a restart or a second sender. */
    private void run(Channel channel, String name, byte[] data, run_t m) {
        if (channel.messages == 0 || m.run_id != runId)
            System.out.println(name + ": " + about(m) + (channel.messages > 0 ? ": a restart, or another sender" : ""));
        runId = m.run_id;
        channel.count(data, channel.last + 1);
    }

    /** This one knows its time, but not the number of its frame. */
    private void botCore(Channel channel, String name, byte[] data, pose_t m) {
        channel.count(data, channel.last + 1);
        if (!quiet)
            System.out.printf(Locale.ROOT, "%s: at %.6f s: position %.3f %.3f %.3f m%n", name, m.utime * 1e-6, m.pos[0], m.pos[1], m.pos[2]);
    }

    private void decode(Channel channel, String suffix, String name, byte[] data) throws IOException {
        switch (suffix) {
            case "POSE":
            case "CAMERA_POSE": {
                fovea.pose_t m = new fovea.pose_t(data);
                frame(channel, name, data, m.stamp, about(m));
                break;
            }
            case "FEATURES": {
                features_t m = new features_t(data);
                frame(channel, name, data, m.stamp, m.count + " of " + m.asked + " features");
                break;
            }
            case "CAMERA_STATUS": {
                camera_status_t m = new camera_status_t(data);
                frame(channel, name, data, m.stamp, "state " + m.state + ", " + m.width + " x " + m.height + " " + m.pixel_format);
                break;
            }
            case "STATISTICS": {
                statistics_t m = new statistics_t(data);
                frame(channel, name, data, m.stamp, m.frames_in + " frames in, " + m.frames_processed + " processed");
                break;
            }
            case "PREVIEW": {
                preview_t m = new preview_t(data);
                frame(channel, name, data, m.stamp, m.width + " x " + m.height + ", " + m.size_bytes + " bytes of JPEG");
                break;
            }
            case "MAP": {
                map_t m = new map_t(data);
                frame(channel, name, data, m.stamp,
                        "map " + m.map_id + ", " + m.landmark_count + " landmarks and " + m.keyframe_count + " keyframes listed");
                break;
            }
            case "DETECTIONS": {
                detections_t m = new detections_t(data);
                frame(channel, name, data, m.stamp, about(m));
                break;
            }
            case "OBJECTS": {
                objects_t m = new objects_t(data);
                frame(channel, name, data, m.stamp, m.count + " objects");
                break;
            }
            case "BOT_CORE_POSE":
                botCore(channel, name, data, new pose_t(data));
                break;
            case "RUN":
                run(channel, name, data, new run_t(data));
                break;
            default: /* of a later version, or not for subscribers */
        }
    }

    /** A message that is cut off or of another type is counted, and no reason to end. */
    private void take(MessageAggregator.Message message) {
        final String suffix = message.channel.substring(prefix.length() + 1);
        final Channel channel = channels.computeIfAbsent(suffix, name -> new Channel());
        try {
            decode(channel, suffix, message.channel, message.data);
        } catch (IOException | RuntimeException | OutOfMemoryError problem) {
            System.err.println(message.channel + ": " + problem);
            channel.malformed++;
        }
    }

    /** Until nothing has come for `idleMs` milliseconds (0: for ever). */
    private void listen(MessageAggregator messages, long idleMs) {
        for (MessageAggregator.Message message; (message = idleMs > 0 ? messages.getNextMessage(idleMs) : messages.getNextMessage()) != null;)
            synchronized (this) {
                take(message);
            }
    }

    private synchronized long report() {
        for (Map.Entry<String, Channel> entry : channels.entrySet()) {
            final Channel c = entry.getValue();
            if (c.messages > 0 || c.malformed > 0)
                System.out.printf("%s %d messages, %d bytes, frames %d to %d, %d malformed%n", entry.getKey(), c.messages, c.bytes, c.first,
                        c.last, c.malformed);
        }
        /* Features come with every frame unless decimated; then gaps are no loss. */
        final Channel features = channels.get("FEATURES");
        if (features == null) return 0;
        System.out.println("missing " + features.gaps);
        return features.gaps;
    }

    private static void usage() {
        System.err.println("usage: Subscribe [--url URL] [--prefix FOVEA] [--idle SECONDS] [--quiet]");
        System.exit(2);
    }

    public static void main(String[] arguments) throws Exception {
        String url = "udpm://239.255.76.67:7667?ttl=0", prefix = "FOVEA";
        boolean quiet = false;
        double idle = 0;
        for (int i = 0; i < arguments.length; i++) {
            if (arguments[i].equals("--quiet")) quiet = true;
            else if (i + 1 == arguments.length) usage();
            else if (arguments[i].equals("--url")) url = arguments[++i];
            else if (arguments[i].equals("--prefix")) prefix = arguments[++i];
            else if (arguments[i].equals("--idle")) idle = Double.parseDouble(arguments[++i]);
            else usage();
        }
        final Subscribe subscriber = new Subscribe(prefix, quiet);
        final MessageAggregator messages = new MessageAggregator();
        messages.setMaxMessages(10000);
        messages.setMaxBufferSize(64 << 20);
        final LCM lcm = new LCM(url);
        lcm.subscribe(Pattern.quote(prefix) + "_.*", messages);
        System.out.println("listening");
        Runtime.getRuntime().addShutdownHook(new Thread(() -> { /* on SIGINT, too */
            final long gaps = subscriber.report();
            System.out.flush();
            Runtime.getRuntime().halt(gaps > 0 ? 1 : 0);
        }));
        subscriber.listen(messages, (long) (1e3 * idle));
        System.exit(0);
    }
}
