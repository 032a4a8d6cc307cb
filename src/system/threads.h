#pragma once
// How many threads this process may use.

#include <optional>
#include <string>

namespace etendue {

/// The processors on which this process may run, but not more than its control groups (containers, batch systems) give
/// it time for. At least 1.
int available_threads();
/// The number of threads that an option asks for, where 0 stands for available_threads().
inline int thread_count(int wanted) {
    return wanted > 0 ? wanted : available_threads();
}

/// The processors' time per second that the control groups of a process allow; empty if they set no limit. `groups`: the
/// text of /proc/self/cgroup; `mounted`: the folder of the file system of control groups, of version 1 or 2.
std::optional<double> processor_quota(const std::string& groups, const std::string& mounted);

}  // namespace etendue
