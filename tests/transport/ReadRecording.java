/* Reads a recording with LCM's own Java and the types of build/fovea-types.jar, as lcm-spy does: every message decodes, and
 * encodes to the same bytes again. Usage: java -cp lcm.jar:fovea-types.jar ReadRecording.java FILE CHANNEL... ; each CHANNEL
 * must have come. */
import java.io.EOFException;
import java.util.Arrays;
import java.util.HashMap;
import java.util.Map;
import lcm.lcm.LCMDataOutputStream;
import lcm.lcm.LCMEncodable;
import lcm.logging.Log;

public class ReadRecording {
    static String typeOf(String channel) {
        String name = channel.substring("FOVEA_".length()).toLowerCase();
        if (name.equals("bot_core_pose")) return "bot_core.pose_t";
        return "fovea." + (name.equals("camera_pose") ? "pose" : name) + "_t";
    }

    static void read(Log.Event event) throws Exception {
        LCMEncodable message = (LCMEncodable) Class.forName(typeOf(event.channel)).getConstructor(byte[].class).newInstance((Object) event.data);
        LCMDataOutputStream again = new LCMDataOutputStream();
        message.encode(again);
        if (!Arrays.equals(event.data, again.toByteArray())) throw new Exception(event.channel + ": other bytes when encoded again");
    }

    public static void main(String[] arguments) throws Exception {
        Log log = new Log(arguments[0], "r");
        Map<String, Integer> counts = new HashMap<>();
        try {
            for (;;) {
                Log.Event event = log.readNext();
                read(event);
                counts.merge(event.channel, 1, Integer::sum);
            }
        } catch (EOFException end) {
            System.out.println(counts);
        }
        for (int i = 1; i < arguments.length; i++)
            if (!counts.containsKey(arguments[i])) throw new Exception(arguments[i] + ": found none");
    }
}
