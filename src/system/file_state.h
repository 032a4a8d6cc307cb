#pragma once

#include <cstdint>
#include <string>

namespace etendue {

/// What tells whether a file has changed since, without reading it.
struct FileState {
    uint64_t device = 0, inode = 0, size = 0;
    int64_t written = 0, changed = 0;  ///< ns since 1970, by the clock of the file system.
    /// Whether so much time has passed since the last change that the next one will have another time.
    bool is_settled = false;

    /// Whether a file that had the state `before` when it was read has the same contents in this one.
    bool has_kept(const FileState& before) const {
        return before.is_settled && device == before.device && inode == before.inode &&
               size == before.size && written == before.written && changed == before.changed;
    }
};

/// Of a file that is not there, a state that is never settled.
FileState file_state(const std::string& file);

}  // namespace etendue
