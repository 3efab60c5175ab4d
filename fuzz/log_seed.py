"""Makes a seed of the target `log`: a log without compression and checksums, so that changed bytes are decoded, with few messages
of each topic.

    pip install mcap
    python log_seed.py case.mcap corpus/log/case.mcap
"""

import sys
from collections import Counter

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

MOST_MESSAGES = 3

source, target = sys.argv[1:]
with open(source, "rb") as old, open(target, "wb") as new:
    reader = make_reader(old)
    # a chunk for each message, as large messages have one
    writer = Writer(new, chunk_size=1, compression=CompressionType.NONE, enable_crcs=False)
    writer.start()
    for attachment in reader.iter_attachments():
        writer.add_attachment(
            attachment.create_time,
            attachment.log_time,
            attachment.name,
            attachment.media_type,
            attachment.data,
        )
    for metadata in reader.iter_metadata():
        writer.add_metadata(metadata.name, metadata.metadata)
    channels = {}
    counts = Counter()
    messages = list(reader.iter_messages())
    # the last checkpoint is the one that a run resumes from
    last = next((m for m in reversed(messages) if m[1].topic == "/checkpoint"), None)
    for schema, channel, message in messages:
        is_checkpoint = channel.topic == "/checkpoint"
        if is_checkpoint and message is not last[2]:
            continue
        if not is_checkpoint and counts[channel.topic] >= MOST_MESSAGES:
            continue
        counts[channel.topic] += 1
        if channel.id not in channels:
            encoding = schema.encoding if schema else ""
            number = writer.register_schema(schema.name, encoding, schema.data) if schema else 0
            channels[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, number, channel.metadata
            )
        writer.add_message(
            channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
        )
    writer.finish()
