// Processes that MPI connects. This is the only file that includes MPI.

#include "system/ranks.h"

#include <cstdlib>

#ifdef ETENDUE_MPI

#include <algorithm>
#include <chrono>
#include <exception>
#include <stdexcept>
#include <thread>

#include <mpi.h>

namespace etendue {
namespace {

void check(int result, const char* what) {
    if (result != MPI_SUCCESS)
        throw std::runtime_error(std::string("the processes cannot exchange data: ") + what +
                                 " failed");
}

/// Waits without taking processor time from the threads of other processes on this machine.
void wait_for(MPI_Request request, const char* what) {
    using std::chrono::microseconds;
    constexpr int kEager = 1000;
    constexpr microseconds kFirst{20}, kLongest{1000};
    int is_done = 0;
    microseconds pause = kFirst;
    for (int i = 0;; ++i) {
        check(MPI_Test(&request, &is_done, MPI_STATUS_IGNORE), what);
        if (is_done) return;
        if (i < kEager) continue;
        std::this_thread::sleep_for(pause);
        pause = std::min(2 * pause, kLongest);
    }
}

/// A type of `size` bytes.
class ElementType {
public:
    explicit ElementType(size_t size) {
        check(MPI_Type_contiguous(int(size), MPI_BYTE, &type_), "MPI_Type_contiguous");
        check(MPI_Type_commit(&type_), "MPI_Type_commit");
    }
    ~ElementType() { MPI_Type_free(&type_); }
    ElementType(const ElementType&) = delete;
    ElementType& operator=(const ElementType&) = delete;
    operator MPI_Datatype() const { return type_; }

private:
    MPI_Datatype type_ = MPI_DATATYPE_NULL;
};

class MpiRanks final : public Ranks {
public:
    MpiRanks() {
        MPI_Comm_size(MPI_COMM_WORLD, &count_);
        MPI_Comm_rank(MPI_COMM_WORLD, &index_);
        MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
        MPI_Comm machine;
        check(MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, index_, MPI_INFO_NULL,
                                  &machine),
              "MPI_Comm_split_type");
        MPI_Comm_size(machine, &on_this_machine_);
        MPI_Comm_free(&machine);
    }
    /// MPI is not finished if the work was not: finishing would wait for the others.
    ~MpiRanks() override {
        if (std::uncaught_exceptions() == 0) MPI_Finalize();
    }

    int count() const override { return count_; }
    int index() const override { return index_; }
    int on_this_machine() const override { return on_this_machine_; }

    void share(void* data, size_t size, std::span<const uint64_t> begins) const override {
        const ElementType type(size);
        const Parts parts(begins);
        MPI_Request request;
        check(MPI_Iallgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, data, parts.counts.data(),
                              parts.begins.data(), type, MPI_COMM_WORLD, &request),
              "MPI_Iallgatherv");
        wait_for(request, "MPI_Iallgatherv");
    }

    void distribute(const void* from, int senders, size_t size, std::span<const uint64_t> begins,
                    void* to) const override {
        const ElementType type(size);
        Parts sent(begins);
        if (index_ >= senders) sent.counts.assign(size_t(count_), 0);
        const int own = int(begins[size_t(index_) + 1] - begins[size_t(index_)]);
        std::vector<int> counts(size_t(count_), 0), places(size_t(count_), 0);
        for (int r = 0; r < senders; ++r) counts[size_t(r)] = own, places[size_t(r)] = r * own;
        MPI_Request request;
        check(MPI_Ialltoallv(from, sent.counts.data(), sent.begins.data(), type, to, counts.data(),
                             places.data(), type, MPI_COMM_WORLD, &request),
              "MPI_Ialltoallv");
        wait_for(request, "MPI_Ialltoallv");
    }

    void broadcast(std::vector<std::byte>& bytes, int from) const override {
        constexpr uint64_t kMost = uint64_t(1) << 30;  // Counts are int.
        uint64_t size = bytes.size();
        broadcast(&size, sizeof size, from);
        bytes.resize(size_t(size));
        for (uint64_t at = 0; at < size; at += kMost)
            broadcast(bytes.data() + at, int(std::min(kMost, size - at)), from);
    }

    std::vector<std::string> gather(std::string_view said) const override {
        const int own = int(said.size());
        std::vector<int> sizes(static_cast<size_t>(count_)), begins{0};
        MPI_Request request;
        check(MPI_Iallgather(&own, 1, MPI_INT, sizes.data(), 1, MPI_INT, MPI_COMM_WORLD, &request),
              "MPI_Iallgather");
        wait_for(request, "MPI_Iallgather");
        for (const int size : sizes) begins.push_back(begins.back() + size);
        std::string all(size_t(begins.back()), '\0');
        check(MPI_Iallgatherv(said.data(), own, MPI_BYTE, all.data(), sizes.data(), begins.data(),
                              MPI_BYTE, MPI_COMM_WORLD, &request),
              "MPI_Iallgatherv");
        wait_for(request, "MPI_Iallgatherv");
        std::vector<std::string> by_rank;
        for (size_t r = 0; r < sizes.size(); ++r)
            by_rank.push_back(all.substr(size_t(begins[r]), size_t(sizes[r])));
        return by_rank;
    }

private:
    /// Ranges in the form of MPI.
    struct Parts {
        explicit Parts(std::span<const uint64_t> all) : begins(all.begin(), all.end() - 1) {
            for (size_t r = 0; r + 1 < all.size(); ++r) counts.push_back(int(all[r + 1] - all[r]));
        }
        std::vector<int> begins, counts;
    };

    static void broadcast(void* bytes, int size, int from) {
        MPI_Request request;
        check(MPI_Ibcast(bytes, size, MPI_BYTE, from, MPI_COMM_WORLD, &request), "MPI_Ibcast");
        wait_for(request, "MPI_Ibcast");
    }

    int count_ = 1, index_ = 0, on_this_machine_ = 1;
};

/// Whether something that starts processes of MPI has started this one.
bool is_started_by_mpi() {
    for (const char* variable : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"})
        if (std::getenv(variable)) return true;
    return false;
}

}  // namespace

std::unique_ptr<const Ranks> join_ranks() {
    if (!is_started_by_mpi()) return std::make_unique<Ranks>();
    // All calls come from the thread that renders; its workers make none.
    int level = 0;
    if (MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &level) != MPI_SUCCESS ||
        level < MPI_THREAD_FUNNELED)
        throw std::runtime_error("MPI cannot be initialised");
    return std::make_unique<MpiRanks>();
}

}  // namespace etendue

#else

namespace etendue {

std::unique_ptr<const Ranks> join_ranks() {
    return std::make_unique<Ranks>();
}

}  // namespace etendue

#endif

namespace etendue {
namespace {

#ifdef ETENDUE_MPI
constexpr const char* kWhyAlone =
    "they are not started for the MPI with which this program was built: use its mpirun, or srun "
    "--mpi=pmix";
#else
constexpr const char* kWhyAlone = "this program was built without MPI (ETENDUE_MPI)";
#endif

/// What starts several processes, and the environment variables with their number and that of this process. Those of Slurm
/// are also set where another one has started the process within a step.
struct Launcher {
    const char *name, *count, *index;
};
constexpr Launcher kLaunchers[] = {
    {"mpirun", "OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"},
    {"mpirun", "PMI_SIZE", "PMI_RANK"},
    {"srun", "SLURM_STEP_NUM_TASKS", "SLURM_PROCID"},
};

}  // namespace

std::string warning_of_strangers(const Ranks& joined) {
    if (joined.count() > 1) return "";
    for (const Launcher& l : kLaunchers) {
        const char *const count = std::getenv(l.count), *const index = std::getenv(l.index);
        if (!count || !index) continue;
        if (std::atoi(count) < 2 || std::atoi(index) != 0) return "";
        return std::string(l.name) + " has started " + count +
               " processes, each of which renders an image of its own: " + kWhyAlone;
    }
    return "";
}

}  // namespace etendue
