// Foxglove's protocol of fovea-web, by the client of npm's @foxglove/ws-protocol: channels, messages, a parameter that is set and one
// that the run refuses. Its name of the protocol is foxglove.websocket.v1.
//
// Usage: node foxglove_client.cjs NODE_MODULES
"use strict";
const path = require("path");
const { FoxgloveClient } = require(path.resolve(process.argv[2], "@foxglove/ws-protocol"));
const WebSocket = require(path.resolve(process.argv[2], "ws"));

function fail(what) {
    console.error(`foxglove_client: ${what}`);
    process.exit(1);
}

function expect(holds, what) {
    if (!holds) fail(what);
}

const channels = new Map(), counts = new Map(), subscribed = new Map();
let info, times = 0, newest = 0n;
const waiting = [];

// Resolve when the condition holds, which is looked at after each message.
function until(holds, what) {
    return new Promise((resolve) => {
        const patience = setTimeout(() => fail(`${what}: not in 120 s`), 120000);
        waiting.push(() => {
            if (!holds()) return false;
            clearTimeout(patience);
            resolve();
            return true;
        });
    });
}

function changed() {
    for (let i = waiting.length - 1; i >= 0; i--) if (waiting[i]()) waiting.splice(i, 1);
}

const client = new FoxgloveClient({ ws: new WebSocket("ws://127.0.0.1:7680/", [FoxgloveClient.SUPPORTED_SUBPROTOCOL]) });
const values = [], statuses = [];
client.on("error", (problem) => fail(problem));
client.on("close", () => fail("the server has closed the connection"));
client.on("serverInfo", (found) => { info = found; });
client.on("status", (found) => { statuses.push(found); changed(); });
client.on("parameterValues", (found) => { values.push(found); changed(); });
client.on("time", (found) => {
    expect(found.timestamp >= newest, "time goes back");
    newest = found.timestamp;
    times++;
    changed();
});
client.on("advertise", (found) => {
    for (const channel of found) {
        channels.set(channel.id, channel);
        subscribed.set(client.subscribe(channel.id), channel.topic);
    }
});
client.on("message", (found) => {
    const topic = subscribed.get(found.subscriptionId);
    expect(topic !== undefined, `subscription ${found.subscriptionId} is none of ours`);
    expect(found.data.byteLength > 0, `${topic}: empty`);
    counts.set(topic, (counts.get(topic) ?? 0) + 1);
    changed();
});

async function main() {
    const wanted = ["cam0/image", "cam0/features", "pose", "camera_pose", "transforms", "map", "log", "statistics", "camera_status"];
    await until(() => times > 10 && wanted.every((name) => counts.has(`/FOVEA/${name}`)), "messages");
    expect(info.capabilities.includes("parameters") && info.capabilities.includes("parametersSubscribe"), "capabilities");
    const image = [...channels.values()].find((channel) => channel.topic === "/FOVEA/cam0/image");
    expect(image.encoding === "protobuf" && image.schemaName === "foxglove.CompressedImage", "schema");

    client.subscribeParameterUpdates(["features.threshold"]);
    client.getParameters(["features.threshold"], "before");
    await until(() => values.some((found) => found.id === "before"), "a value");
    client.setParameters([{ name: "features.threshold", value: 27 }], "set");
    await until(() => values.some((found) => found.id === "set" && found.parameters[0].value === 27), "the value that was set");
    await until(() => values.some((found) => found.id === undefined && found.parameters[0].value === 27), "an update");
    client.setParameters([{ name: "features.threshold", value: -5 }], "wrong");
    await until(() => statuses.some((found) => found.level === 2 && found.message.startsWith("features.threshold: ")), "a refusal");
    await until(() => values.some((found) => found.id === "wrong" && found.parameters[0].value === 27), "the value in force");

    const pose = [...subscribed].find(([, topic]) => topic === "/FOVEA/pose");
    client.unsubscribe(pose[0]);
    client.getParameters(["features.threshold"], "after"); // answered after that was taken
    await until(() => values.some((found) => found.id === "after"), "a value");
    const before = counts.get("/FOVEA/pose"), frames = counts.get("/FOVEA/cam0/features");
    await until(() => counts.get("/FOVEA/cam0/features") > frames + 5, "more messages");
    expect(counts.get("/FOVEA/pose") === before, "poses come after they were unsubscribed");
    console.log(`${[...counts.values()].reduce((a, b) => a + b)} messages on ${counts.size} topics`);
    process.exit(0);
}

main();
