// Every renderer uses the number of threads it was given, independent of other renderers in the same process.

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

/// Counts the threads of a rendering that are in attend() at once. A thread waits there until as many as wanted have
/// come, and a little longer for one too many. Threads may take turns: TBB may send one away and give its place to another.
class Meeting {
public:
    explicit Meeting(size_t wanted) : wanted_(wanted) {}

    void attend() {
        std::unique_lock lock(mutex_);
        most_ = std::max(most_, ++present_);
        changed_.notify_all();
        changed_.wait_for(lock, std::chrono::seconds(5), [&] { return most_ >= wanted_; });
        changed_.wait_for(lock, std::chrono::milliseconds(5), [&] { return most_ > wanted_; });
        --present_;
    }
    /// The largest number of threads that were there at once.
    size_t most() const { return most_; }

private:
    size_t wanted_;
    size_t present_ = 0;
    size_t most_ = 0;
    std::mutex mutex_;
    std::condition_variable changed_;
};

class MeetingIntegrator final : public Integrator {
public:
    explicit MeetingIntegrator(Meeting& meeting) : meeting_(meeting) {}
    void sample(const SampleContext& c, Workspace&) const override {
        if (c.index % 256 == 0) meeting_.attend();  // once a chunk
    }
    TechniqueCounts counts(const Scene&, uint64_t) const override { return {}; }
    uint64_t light_paths(const Scene&) const override { return 0; }
    Estimator estimator() const override { return Estimator::Unbiased; }
    void save(LearnedState&) const override {}
    void load(LearnedState&) override {}

private:
    Meeting& meeting_;
};

/// A rendering of one pass whose threads are counted.
class CountedRendering {
public:
    CountedRendering(const Scene& scene, int threads)
        : meeting_(size_t(threads)),
          renderer_(scene, settings(threads), std::make_unique<MeetingIntegrator>(meeting_)) {}

    /// Threads that it had at once.
    size_t run() {
        const std::atomic<bool> interrupted{false};
        renderer_.run([](const Progress&) {}, interrupted);
        return meeting_.most();
    }

private:
    static RenderSettings settings(int threads) {
        RenderSettings s;
        s.threads = threads;
        s.spp = 1;
        return s;
    }

    Meeting meeting_;
    Renderer renderer_;
};

size_t threads_of_rendering(const Scene& scene, int threads) {
    return CountedRendering(scene, threads).run();
}

TEST(Threads, AreAsManyAsAskedFor) {
    const Scene scene = build(front_camera(64) + room() + area_lamp());
    for (const int threads : {1, 2, 7, 3}) EXPECT_EQ(threads_of_rendering(scene, threads), threads);
}

TEST(Threads, OfSeveralRenderersAtOnceAreTheirOwn) {
    const Scene scene = build(front_camera(64) + room() + area_lamp());
    const std::vector<int> wanted = {7, 2, 1, 5};
    std::vector<size_t> had(wanted.size());
    std::vector<std::thread> callers;
    for (size_t i = 0; i < wanted.size(); ++i)
        callers.emplace_back([&, i] { had[i] = threads_of_rendering(scene, wanted[i]); });
    for (std::thread& c : callers) c.join();
    for (size_t i = 0; i < wanted.size(); ++i) EXPECT_EQ(had[i], wanted[i]) << i;
}

TEST(Threads, OutliveThoseOfRenderersThatEnded) {
    const Scene scene = build(front_camera(64) + room() + area_lamp());
    auto earlier = std::make_unique<CountedRendering>(scene, 7);
    CountedRendering later(scene, 5);
    EXPECT_EQ(earlier->run(), 7);
    earlier.reset();
    EXPECT_EQ(later.run(), 5);
}

}  // namespace
}  // namespace etendue::test
