#include "system/threads.h"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>
#include <vector>

namespace etendue {
namespace {

namespace fs = std::filesystem;

/// The file's number; empty if it has none, such as "max".
std::optional<double> number_in(const fs::path& file) {
    std::ifstream in(file);
    double value = 0;
    return in >> value ? std::optional(value) : std::nullopt;
}

/// The limit of one group.
std::optional<double> quota_of(const fs::path& group, bool is_version_2) {
    std::optional<double> quota, period;
    if (is_version_2) {
        std::ifstream in(group / "cpu.max");
        double a = 0, b = 0;
        if (in >> a >> b) quota = a, period = b;
    } else {
        quota = number_in(group / "cpu.cfs_quota_us");
        period = number_in(group / "cpu.cfs_period_us");
    }
    if (!quota || !period || !(*quota > 0) || !(*period > 0)) return {};
    return *quota / *period;
}

int processors_by_affinity() {
    // Larger machines need a larger set than cpu_set_t.
    for (size_t count = 1024; count <= 1u << 20; count *= 2) {
        const size_t bytes = CPU_ALLOC_SIZE(count);
        std::vector<char> memory(bytes);
        auto* set = reinterpret_cast<cpu_set_t*>(memory.data());
        if (::sched_getaffinity(0, bytes, set) == 0) return CPU_COUNT_S(bytes, set);
    }
    return int(std::thread::hardware_concurrency());
}

}  // namespace

std::optional<double> processor_quota(const std::string& groups, const std::string& mounted) {
    // Lines such as "0::/user.slice" (version 2) and "4:cpu,cpuacct:/docker/1a2b" (version 1).
    std::optional<double> least;
    std::istringstream lines(groups);
    for (std::string line; std::getline(lines, line);) {
        const size_t first = line.find(':');
        const size_t second = first == line.npos ? first : line.find(':', first + 1);
        if (second == line.npos) continue;
        const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
        const bool is_version_2 = controllers == ",,";
        if (!is_version_2 && controllers.find(",cpu,") == controllers.npos) continue;
        const fs::path root = is_version_2 ? fs::path(mounted) : fs::path(mounted) / "cpu";
        // The limits of all groups around it apply too. In a container, the path may be one of the machine outside.
        fs::path group = fs::path(line.substr(second + 1)).relative_path();
        while (true) {
            if (const auto quota = quota_of(root / group, is_version_2))
                least = std::min(least.value_or(*quota), *quota);
            if (group.empty()) break;
            group = group.parent_path();
        }
    }
    return least;
}

int available_threads() {
    int threads = std::max(1, processors_by_affinity());
    std::ifstream in("/proc/self/cgroup");
    const std::string groups{std::istreambuf_iterator<char>(in), {}};
    if (const auto quota = processor_quota(groups, "/sys/fs/cgroup"))
        threads = std::min(threads, std::max(1, int(std::ceil(*quota))));
    return threads;
}

}  // namespace etendue
