// Runs of a session: their images are those of a plain rendering; commands; snapshots and their budget.

#include "session/session.h"

#include <cstring>
#include <filesystem>
#include <random>

#include <gtest/gtest.h>

#include "session/workers.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

using namespace std::chrono_literals;

Scene small_room() {
    return build(sensor("0,0,3.5", "0,0,0", 24) + room() + area_lamp());
}

template <class Condition>
bool wait_for(const Condition& condition) {
    for (int i = 0; i < 6000; ++i) {
        if (condition()) return true;
        std::this_thread::sleep_for(5ms);
    }
    return false;
}

bool wait_for_scene(const Session& session) {
    return wait_for([&] { return session.scene() || !session.load_error().empty(); });
}

RunRequest request(const std::string& integrator, uint64_t spp) {
    RunRequest r;
    r.integrator = integrator;
    r.seed = 3;
    r.limits.spp = spp;
    return r;
}

std::vector<Rgb> plain_image(const Scene& scene, const RunRequest& r) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(r.integrator);
    settings.sampler = r.sampler;
    settings.seed = r.seed;
    settings.threads = 1;
    settings.spp = r.limits.spp;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    return renderer.film().image();
}

class SessionBits : public ::testing::TestWithParam<std::tuple<const char*, int>> {};

TEST_P(SessionBits, AreThoseOfRenderThroughStopsAndSnapshots) {
    const auto& [integrator, threads] = GetParam();
    constexpr int kStops = 20;
    const RunRequest r = request(integrator, 3 * kStops);
    Session session(small_room, threads);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = session.start(r);
    for (int stops = 1; stops <= kStops; ++stops) {
        wait_for([&] {
            session.snapshot(run);
            const RunStatus s = session.status(run);
            return s.passes >= uint64_t(stops) || s.state == RunState::Finished;
        });
        stops % 2 == 0 ? session.stop(run) : session.discard(run);
        session.snapshot(run);
        session.resume(run, {});
    }
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    ASSERT_TRUE(wait_for([&] { return session.snapshot(run)->passes == 3 * kStops; }));
    const std::shared_ptr<const Snapshot> shown = session.snapshot(run);
    const std::vector<Rgb> expected = plain_image(small_room(), r);
    ASSERT_EQ(shown->mean.size(), expected.size());
    EXPECT_EQ(std::memcmp(shown->mean.data(), expected.data(), expected.size() * sizeof(Rgb)), 0);
    const RunStatus s = session.status(run);
    EXPECT_EQ(s.passes, 3u * kStops);
    EXPECT_EQ(s.snapshot_passes, s.passes);
    EXPECT_FALSE(s.history.empty());
}

INSTANTIATE_TEST_SUITE_P(Methods, SessionBits,
                         ::testing::Combine(::testing::Values("path", "bdpt", "vcm"),
                                            ::testing::Values(1, 2)));

TEST(Session, SnapshotHasTheVarianceOfTheFilm) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const RunRequest r = request("path", 8);
    const int run = session.start(r);
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    const Scene scene = small_room();
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse("path");
    settings.sampler = r.sampler;
    settings.seed = r.seed;
    settings.spp = r.limits.spp;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    const std::vector<Rgb> expected = renderer.film().variance();
    const auto shown = session.snapshot(run);
    ASSERT_EQ(shown->variance.size(), expected.size());
    for (size_t i = 0; i < expected.size(); ++i)
        for (int c = 0; c < 3; ++c)
            ASSERT_NEAR(shown->variance[i][c], expected[i][c], 1e-5f * expected[i][c]);
}

TEST(Session, RunsTakeTurnsAndCanBeRemoved) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int a = session.start(request("path", 1u << 30)), b = session.start(request("light", 4));
    EXPECT_NE(a, b);
    ASSERT_TRUE(wait_for([&] { return session.status(b).state == RunState::Finished; }));
    EXPECT_EQ(session.status(a).state, RunState::Rendering);
    EXPECT_EQ(session.status(b).passes, 4u);
    session.remove(a);
    ASSERT_TRUE(wait_for([&] { return session.runs().size() == 1; }));
    EXPECT_THROW(session.status(a), std::runtime_error);
    RenderLimits more;
    more.spp = 9;
    session.resume(b, more);
    ASSERT_TRUE(wait_for([&] { return session.status(b).passes == 9; }));
}

TEST(Session, RefusesWithTheIntegratorsMessage) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    for (const char* bad : {"nonsense", "path:max_depth=-7", "bdpt:depth=3"}) {
        std::string expected, message;
        try {
            make_integrator(IntegratorSpec::parse(bad));
        } catch (const std::exception& e) {
            expected = e.what();
        }
        try {
            session.start(request(bad, 1));
        } catch (const std::exception& e) {
            message = e.what();
        }
        EXPECT_FALSE(message.empty());
        EXPECT_EQ(message, expected);
    }
    EXPECT_TRUE(session.runs().empty());
}

TEST(Session, SavesBetweenPasses) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = session.start(request("path", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session.status(run).passes > 2; }));
    const std::string file =
        (std::filesystem::temp_directory_path() / "etendue-session-test.pfm").string();
    std::atomic<bool> is_done{false};
    std::string error;
    session.save(run, file, [&](const std::string& e) {
        error = e;
        is_done = true;
    });
    ASSERT_TRUE(wait_for([&] { return is_done.load(); }));
    EXPECT_EQ(error, "");
    EXPECT_TRUE(std::filesystem::remove(file));
}

TEST(Session, TechniqueImagesAreMadeOnDemand) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    RunRequest r = request("bdpt", 3);
    r.technique_depth = 3;
    const int run = session.start(r);
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    ASSERT_TRUE(wait_for([&] { return session.techniques(run) != nullptr; }));
    EXPECT_EQ(session.techniques(run)->passes, 3u);
    EXPECT_FALSE(session.techniques(run)->images.empty());
}

TEST(Session, FailureToLoadIsKept) {
    std::atomic<bool> is_bad{true};
    Session session(
        [&] {
            if (is_bad) throw std::runtime_error("no such scene");
            return small_room();
        },
        1);
    ASSERT_TRUE(wait_for_scene(session));
    EXPECT_EQ(session.load_error(), "no such scene");
    EXPECT_THROW(session.start(request("path", 1)), std::runtime_error);
    is_bad = false;
    session.reload();
    ASSERT_TRUE(wait_for([&] { return session.scene() != nullptr; }));
    EXPECT_EQ(session.load_error(), "");
    const int run = session.start(request("path", 1u << 30));
    session.reload();
    ASSERT_TRUE(wait_for([&] { return !session.status(run).is_of_this_scene; }));
    EXPECT_TRUE(wait_for([&] { return session.status(run).state == RunState::Stopped; }));
}

TEST(Session, StoppedRunsShowTheirLastPass) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    // Two runs, so that one is stopped within its turn, and the other between its turns.
    const int runs[] = {session.start(request("path", 1u << 30)),
                        session.start(request("bdpt", 1u << 30))};
    for (uint64_t round = 1; round <= 3; ++round) {
        for (const int run : runs)
            ASSERT_TRUE(wait_for([&] { return session.status(run).passes >= round; }));
        for (const int run : runs) session.stop(run);
        for (const int run : runs) {
            RunStatus status;
            ASSERT_TRUE(wait_for([&] {
                status = session.status(run);
                return status.state == RunState::Stopped;
            }));
            EXPECT_EQ(status.snapshot_passes, status.passes);
            EXPECT_EQ(session.snapshot(run)->passes, status.passes);
        }
        for (const int run : runs) session.resume(run, {});
    }
}

/// Also where the session has not yet carried out the resumption.
TEST(Session, AStopFollowsTheResumptionBefore) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = session.start(request("path", 1u << 30));
    session.stop(run);
    const auto is_stopped = [&] { return session.status(run).state == RunState::Stopped; };
    ASSERT_TRUE(wait_for(is_stopped));
    for (int i = 0; i < 20; ++i) {
        session.resume(run, {});
        session.stop(run);
        std::atomic<bool> is_idle{false};
        session.save(run, "", [&](const std::string&) { is_idle = true; });
        ASSERT_TRUE(wait_for([&] { return is_idle.load(); }));  // after the commands before
        ASSERT_TRUE(wait_for(is_stopped));
    }
}

/// Commands and queries of four threads at a time, while the scene is loaded again.
TEST(Session, TakesCommandsOfSeveralThreads) {
    Session session(small_room, 2);
    ASSERT_TRUE(wait_for_scene(session));
    for (int i = 0; i < 3; ++i) session.start(request("path", 1u << 30));
    const auto user = [&](uint32_t seed) {
        std::mt19937 random(seed);
        constexpr int kCommands = 300;
        for (int i = 0; i < kCommands; ++i) {
            const int run = 1 + int(random() % 6);
            try {
                switch (random() % 12) {
                case 0: {
                    RunRequest r = request(random() % 2 ? "bdpt" : "vcm", 1 + random() % 100);
                    r.technique_depth = int(random() % 4);
                    r.seeds = 1 + int(random() % 2);
                    session.start(r);
                    break;
                }
                case 1: session.stop(run); break;
                case 2: session.discard(run); break;
                case 3:
                case 4: session.resume(run, {}); break;
                case 5:
                    if (random() % 4 == 0) session.remove(run);
                    break;
                case 6:
                    if (random() % 8 == 0) session.reload();
                    break;
                case 7: session.techniques(run); break;
                case 8:
                    session.replay_last(run, 5, 10, [](const Replay&, const std::string&) {});
                    break;
                case 9: session.seed_series(run); break;
                case 10: session.spent(1e-4); break;
                default:
                    if (const auto shown = session.snapshot(run)) {
                        EXPECT_EQ(shown->mean.size(), size_t(24 * 24));
                    }
                }
            } catch (const std::runtime_error&) {
                // Another thread removed the run.
            }
            for (const RunStatus& s : session.runs()) EXPECT_NE(s.state, RunState::Failed);
        }
    };
    std::vector<std::thread> users;
    for (uint32_t i = 0; i < 4; ++i) users.emplace_back(user, i);
    for (std::thread& t : users) t.join();
    session.settle();
    session.stop_all(true);
    session.settle();
    for (const RunStatus& s : session.runs())
        EXPECT_TRUE(s.state == RunState::Stopped || s.state == RunState::Finished);
}

/// The renderings of a run with several seeds are those of `render` with each seed, in turns with another run; the run
/// shows their mean.
TEST(Session, SeveralSeedsAreRenderedOneAfterTheOther) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    RunRequest r = request("bdpt", 3);
    r.seeds = 3;
    const int run = session.start(r), other = session.start(request("path", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    RunStatus status = session.status(run);
    EXPECT_EQ(status.finished_seeds, 3);
    EXPECT_EQ(status.passes, 9u);
    EXPECT_EQ(status.snapshot_passes, 9u);
    EXPECT_EQ(status.interval, IntervalKind::None);
    EXPECT_EQ(session.status(other).state, RunState::Rendering);
    session.stop(other);
    // Continuing adds as many seeds again, also through a stop.
    session.resume(run, {});
    session.stop(run);
    session.resume(run, {});
    ASSERT_TRUE(wait_for([&] { return session.status(run).finished_seeds == 6; }));
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    const auto series = session.seed_series(run);
    const auto shown = session.snapshot(run);
    ASSERT_EQ(series->luminance.size(), 6u);
    std::vector<Rgb> sum(shown->mean.size());
    for (const auto& image : series->luminance) {
        const std::vector<Rgb> expected = plain_image(small_room(), r);
        for (size_t i = 0; i < expected.size(); ++i) {
            ASSERT_FLOAT_EQ((*image)[i], luminance(expected[i])) << r.seed;
            sum[i] += expected[i];
        }
        ++r.seed;
    }
    EXPECT_EQ(shown->passes, 18u);
    for (size_t i = 0; i < sum.size(); ++i)
        for (int c = 0; c < 3; ++c) ASSERT_NEAR(shown->mean[i][c], sum[i][c] / 6, 1e-5f);
    EXPECT_TRUE(session.seed_series(other)->luminance.empty());
}

TEST(Session, ReplaysTheLastPass) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = session.start(request("vcm", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session.status(run).passes > 2; }));
    std::atomic<bool> is_done{false};
    size_t paths = 0;
    std::string problem;
    const auto replay = [&] {
        is_done = false;
        session.replay_last(run, 300, 1000, [&](const Replay& r, const std::string& error) {
            paths = r.paths.size();
            problem = error;
            is_done = true;
        });
        return wait_for([&] { return is_done.load(); });
    };
    ASSERT_TRUE(replay());
    EXPECT_EQ(problem, "");
    EXPECT_GT(paths, 0u);
    EXPECT_EQ(session.status(run).state, RunState::Rendering);
}

TEST(SnapshotBudget, KeepsTheShare) {
    SnapshotBudget budget;
    SnapshotBudget::Clock::time_point now{};
    constexpr double kCost = 0.013, kPass = 0.05, kLength = 100;
    double used = 0;
    int taken = 0;
    for (int pass = 0; double(pass) * kPass < kLength; ++pass) {
        now += std::chrono::microseconds(int(kPass * 1e6));
        if (!budget.allows(now)) continue;
        budget.taken(now, kCost);
        budget.spent(0.5 * kCost);
        used += 1.5 * kCost;
        ++taken;
    }
    EXPECT_GT(taken, 50);
    constexpr double kShare = 0.02;
    EXPECT_LE(used, kShare * kLength * 1.05);
}

TEST(Session, SnapshotsWaitForTheBudget) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = session.start(request("path", 1u << 30));
    ASSERT_TRUE(wait_for([&] {
        const auto shown = session.snapshot(run);
        return shown && shown->passes > 1;
    }));
    // A picture whose sending took a second of processor time: none follows for 50 s, except at a stop.
    session.spent(1);
    session.settle();
    const uint64_t shown = session.snapshot(run)->passes, passes = session.status(run).passes;
    ASSERT_TRUE(wait_for([&] {
        session.snapshot(run);
        return session.status(run).passes > passes + 20;
    }));
    EXPECT_EQ(session.snapshot(run)->passes, shown);
    session.stop(run);
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Stopped; }));
    EXPECT_EQ(session.snapshot(run)->passes, session.status(run).passes);
}

TEST(SnapshotPool, GivesNoMemoryAwayThatAReaderHolds) {
    SnapshotPool pool;
    const Snapshot* first = nullptr;
    {
        const auto a = pool.take(), b = pool.take();
        EXPECT_NE(a, b);
        first = a.get();
    }
    const auto c = pool.take(), d = pool.take();
    EXPECT_TRUE(c.get() == first || d.get() == first);
    std::shared_ptr<Snapshot> survivor;
    {
        SnapshotPool shortlived;
        survivor = shortlived.take();
    }
    survivor->passes = 1;
}

TEST(Workers, RefuseWhenTooManyWait) {
    std::atomic<bool> may_end{false};
    std::atomic<int> ended{0};
    Workers workers;
    size_t taken = 0;
    for (int i = 0; i < 100; ++i)
        taken += workers.post([&] {
            while (!may_end) std::this_thread::sleep_for(1ms);
            ++ended;
        });
    EXPECT_GE(taken, Workers::kMostWaiting);
    EXPECT_LE(taken, Workers::kMostWaiting + Workers::kThreads);
    may_end = true;
    EXPECT_TRUE(wait_for([&] { return size_t(ended.load()) == taken; }));
}

}  // namespace
}  // namespace etendue::test
