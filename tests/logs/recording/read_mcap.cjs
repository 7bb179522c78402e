// Reads a log with @mcap/core, by its index, and prints counts and the state's values as JSON.
// node read_mcap.cjs NODE_MODULES LOG.mcap
const { createRequire } = require("node:module");
const { open } = require("node:fs/promises");
const there = createRequire(process.argv[2] + "/here.js");
const { McapIndexedReader } = there("@mcap/core");
const { loadDecompressHandlers, protobufFromBinaryDescriptor } = there("@mcap/support");

async function main() {
  const file = await open(process.argv[3], "r");
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const data = new Uint8Array(Number(length));
      const { bytesRead } = await file.read(data, 0, data.length, Number(offset));
      return data.subarray(0, bytesRead);
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
  const counts = {}, sums = {}, types = {}, stamps = [];
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId), schema = reader.schemasById.get(channel.schemaId);
    counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
    types[schema.id] ??= protobufFromBinaryDescriptor(schema.data).lookupType(schema.name);
    const value = types[schema.id].toObject(types[schema.id].decode(message.data), { keepCase: true });
    if (channel.topic !== "/state") continue;
    stamps.push(String(message.logTime));
    for (const [name, number] of Object.entries(value)) (sums[name] ??= []).push(number);
  }
  const attachments = [];
  for await (const item of reader.readAttachments()) attachments.push(item.name);
  const statistics = Object.fromEntries(
    [...reader.statistics.channelMessageCounts].map(([id, n]) => [reader.channelsById.get(id).topic, Number(n)]));
  console.log(JSON.stringify({ counts, statistics, stamps, sums, attachments }));
  await file.close();
}
main();
