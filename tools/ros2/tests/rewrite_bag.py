"""rewrite_bag.py FROM TO: writes a bag in every storage and compression that rosbag2 has, into folders under TO.

Needs the package `rosbags`, an implementation of bags that shares no code with this repository.
"""

import sys
from pathlib import Path

from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

FORMS = {
    "mcap-none": (StoragePlugin.MCAP, CompressionMode.NONE),
    "mcap-chunks": (StoragePlugin.MCAP, CompressionMode.STORAGE),
    "mcap-file": (StoragePlugin.MCAP, CompressionMode.FILE),
    "mcap-message": (StoragePlugin.MCAP, CompressionMode.MESSAGE),
    "sqlite-none": (StoragePlugin.SQLITE3, CompressionMode.NONE),
    "sqlite-file": (StoragePlugin.SQLITE3, CompressionMode.FILE),
    "sqlite-message": (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
}


def rewrite(source, target, storage, mode):
    """Every message is decoded and encoded again."""
    typestore = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(target, version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with Reader(source) as reader, writer:
        topics = {
            it.id: writer.add_connection(it.topic, it.msgtype, typestore=typestore) for it in reader.connections
        }
        for connection, stamp, data in reader.messages():
            message = typestore.deserialize_cdr(data, connection.msgtype)
            writer.write(topics[connection.id], stamp, typestore.serialize_cdr(message, connection.msgtype))


if __name__ == "__main__":
    for name, (storage, mode) in FORMS.items():
        rewrite(Path(sys.argv[1]), Path(sys.argv[2]) / name, storage, mode)
        print(name)
