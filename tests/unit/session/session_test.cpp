// Runs of a session: their images are those of a plain rendering; commands; snapshots and their budget.

#include "session/session.h"

#include <atomic>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <future>
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include "no_memory.h"
#include "render/method_choice.h"
#include "run_program.h"
#include "run_request.h"
#include "session/workers.h"
#include "test_scenes.h"
#include "wait_for.h"

namespace etendue::test {
namespace {

using namespace std::chrono_literals;

Scene small_room() {
    return build(sensor("0,0,3.5", "0,0,0", 24) + room() + area_lamp());
}

bool wait_for_scene(const Session& session) {
    return wait_for([&] { return session.scene() || !session.load_error().empty(); });
}

std::vector<Rgb> plain_image(const Scene& scene, const RunRequest& r) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(r.integrator);
    settings.sampler = r.sampler;
    settings.seed = r.seed;
    settings.threads = 1;
    settings.spp = r.spp;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    return renderer.film().image();
}

/// A run of three passes with technique images that nobody has asked for yet.
int run_with_techniques(Session& session) {
    RunRequest r = run_of("bdpt", 3);
    r.technique_depth = 3;
    const int run = session.start(r);
    EXPECT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    return run;
}

/// What becomes of an image that is saved.
Saved saved(Session& session, int run) {
    const TemporaryFolder folder;
    const std::filesystem::path file = folder.path() / "image.pfm";
    std::promise<Saved> answer;
    session.save(run, file.string(), false, [&](const Saved& s) { answer.set_value(s); });
    const Saved result = answer.get_future().get();
    EXPECT_EQ(std::filesystem::exists(file), result.error.empty());
    return result;
}

class SessionBits : public ::testing::TestWithParam<std::tuple<const char*, int>> {};

TEST_P(SessionBits, AreThoseOfRenderThroughStopsAndSnapshots) {
    const auto& [integrator, threads] = GetParam();
    constexpr int kStops = 20;
    const RunRequest r = run_of(integrator, 3 * kStops);
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
    const RunRequest r = run_of("path", 8);
    const int run = session.start(r);
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    const Scene scene = small_room();
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse("path");
    settings.sampler = r.sampler;
    settings.seed = r.seed;
    settings.spp = r.spp;
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
    const int a = session.start(run_of("path", 1u << 30)), b = session.start(run_of("light", 4));
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
            session.start(run_of(bad, 1));
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
    const int run = session.start(run_of("path", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session.status(run).passes > 2; }));
    EXPECT_EQ(saved(session, run).error, "");
}

TEST(Session, TechniqueImagesAreMadeOnDemand) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = run_with_techniques(session);
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
    EXPECT_THROW(session.start(run_of("path", 1)), std::runtime_error);
    is_bad = false;
    session.reload();
    ASSERT_TRUE(wait_for([&] { return session.scene() != nullptr; }));
    EXPECT_EQ(session.load_error(), "");
    const int run = session.start(run_of("path", 1u << 30));
    session.reload();
    ASSERT_TRUE(wait_for([&] { return !session.status(run).is_of_this_scene; }));
    EXPECT_TRUE(wait_for([&] { return session.status(run).state == RunState::Stopped; }));
}

TEST(Session, FailureToLoadIsKeptEvenWithoutAText) {
    Session session([]() -> LoadedScene { throw std::runtime_error(""); }, 1);
    ASSERT_TRUE(wait_for([&] { return !session.is_loading() && !session.load_error().empty(); }));
    EXPECT_EQ(session.load_error(), "a failure without a name");
}

TEST(Session, StoppedRunsShowTheirLastPass) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    // Two runs, so that one is stopped within its turn, and the other between its turns.
    const int runs[] = {session.start(run_of("path", 1u << 30)),
                        session.start(run_of("bdpt", 1u << 30))};
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
    const int run = session.start(run_of("path", 1u << 30));
    session.stop(run);
    const auto is_stopped = [&] { return session.status(run).state == RunState::Stopped; };
    ASSERT_TRUE(wait_for(is_stopped));
    for (int i = 0; i < 20; ++i) {
        session.resume(run, {});
        session.stop(run);
        session.settle();  // after the commands before
        ASSERT_TRUE(wait_for(is_stopped));
    }
}

/// Commands and queries of four threads at a time, while the scene is loaded again.
TEST(Session, TakesCommandsOfSeveralThreads) {
    const TemporaryFolder folder;
    Session session(small_room, 2, {.folder = folder.path().string(), .every = 0.05});
    ASSERT_TRUE(wait_for_scene(session));
    for (int i = 0; i < 3; ++i) session.start(run_of("path", 1u << 30));
    const auto user = [&](uint32_t seed) {
        std::mt19937 random(seed);
        constexpr int kCommands = 300;
        for (int i = 0; i < kCommands; ++i) {
            const int run = 1 + int(random() % 6);
            try {
                switch (random() % 14) {
                case 0: {
                    RunRequest r = run_of(random() % 2 ? "bdpt" : "vcm", 1 + random() % 100);
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
                case 11: session.list_kept(); break;
                case 12:
                    for (const KeptRun& k : session.kept()) {
                        session.open(k.file, [](const Opened& o) { EXPECT_EQ(o.error, ""); });
                        break;
                    }
                    break;
                default:
                    if (const auto shown = session.snapshot(run)) {
                        EXPECT_EQ(shown->mean.size(), size_t(24 * 24));
                    }
                }
            } catch (const std::runtime_error&) {
                // Another thread removed the run, or too many files wait.
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

/// The pilots of `auto` take time before the first seed, and no other.
TEST(Seeds, CountTheChoiceOfTheMethodOnce) {
    Session session(small_room, 2);
    ASSERT_TRUE(wait_for_scene(session));
    // The pilots of a rendering 100 times as long.
    RunRequest r = run_of("auto:chains=false,threads=100", 1);
    r.spp = {};
    r.seconds = 0.05;
    r.seeds = 3;
    const int run = session.start(r);
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    const auto choice = session.status(run).choice;
    ASSERT_TRUE(choice);
    EXPECT_GT(choice->candidates.front().images, 0);
    const auto series = session.seed_series(run);
    ASSERT_EQ(series->seconds.size(), 3u);
    EXPECT_GE(series->seconds[0], choice->seconds);
    EXPECT_LT(series->seconds[1], choice->seconds);
    EXPECT_LT(series->seconds[2], choice->seconds);
}

/// A run whose method is being chosen ends at once.
TEST(Session, StopsWhilePilotsRender) {
    Session session([] { return build(sensor("0,0,3.5", "0,0,0", 240) + room() + area_lamp()); },
                    1);
    ASSERT_TRUE(wait_for_scene(session));
    for (const bool discards : {false, true}) {
        const int run = session.start(run_of("auto", 1u << 30));
        std::this_thread::sleep_for(300ms);
        const auto begin = std::chrono::steady_clock::now();
        discards ? session.discard(run) : session.stop(run);
        ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Stopped; }));
        EXPECT_LT(std::chrono::steady_clock::now() - begin, 2s);
        EXPECT_FALSE(session.status(run).choice);
        EXPECT_EQ(session.status(run).passes, 0u);
    }
}

/// The renderings of a run with several seeds are those of `render` with each seed, in turns with another run; the run
/// shows their mean.
TEST(Session, SeveralSeedsAreRenderedOneAfterTheOther) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    RunRequest r = run_of("bdpt", 3);
    r.seeds = 3;
    const int run = session.start(r), other = session.start(run_of("path", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    RunStatus status = session.status(run);
    EXPECT_EQ(status.finished_seeds, 3);
    EXPECT_EQ(status.passes, 9u);
    EXPECT_EQ(status.snapshot_passes, 9u);
    EXPECT_EQ(status.interval, IntervalKind::None);
    EXPECT_EQ(session.status(other).state, RunState::Rendering);
    session.stop(other);
    EXPECT_THROW(session.resume(run, {.spp = 8, .seconds = {}, .error = {}}), std::runtime_error);
    EXPECT_EQ(session.status(run).seeds, 3);
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
    const int run = session.start(run_of("vcm", 1u << 30));
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

// -- What fails.

/// No image can be copied when the run ends, or is stopped: the run keeps its passes, which are shown once there is
/// memory again.
TEST(SessionFailures, ARunOutlivesAPictureWithoutMemory) {
    for (const bool stops : {false, true}) {
        Session session(small_room, 1);
        ASSERT_TRUE(wait_for_scene(session));
        const int run = session.start(run_of("path", 1));
        ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
        // Its reader keeps the memory, so that another picture needs new one.
        const auto first = session.snapshot(run);
        {
            const NoMemoryFor images(size_t(24 * 24) * sizeof(Rgb));
            RenderLimits more;
            more.spp = stops ? 1u << 30 : 5;
            session.resume(run, more);
            ASSERT_TRUE(wait_for([&] { return session.status(run).passes >= 5; }));
            if (stops) session.stop(run);
            const RunState expected = stops ? RunState::Stopped : RunState::Finished;
            ASSERT_TRUE(wait_for([&] { return session.status(run).state == expected; }))
                << to_string(session.status(run).state);
            EXPECT_EQ(session.snapshot(run), first);
            session.settle();
        }
        const uint64_t passes = session.status(run).passes;
        ASSERT_TRUE(wait_for([&] { return session.snapshot(run)->passes == passes; }));
        RenderLimits more;
        more.spp = passes + 2;
        session.resume(run, more);
        ASSERT_TRUE(wait_for([&] { return session.status(run).passes == passes + 2; }));
    }
}

TEST(SessionFailures, TechniqueImagesWithoutMemoryComeLater) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = run_with_techniques(session);
    session.settle();
    {
        const NoMemoryFor images(size_t(24 * 24) * sizeof(Rgb));
        EXPECT_EQ(session.techniques(run), nullptr);
        session.settle();
        EXPECT_EQ(session.techniques(run), nullptr);
        session.settle();
    }
    ASSERT_TRUE(wait_for([&] { return session.techniques(run) != nullptr; }));
    EXPECT_EQ(session.status(run).state, RunState::Finished);
}

TEST(SessionFailures, ARunWithoutMemoryCanBeContinued) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    int run = 0;
    {
        const NoMemoryFor images(size_t(24 * 24) * sizeof(Rgb));
        run = session.start(run_of("path", 4));
        ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Failed; }));
        EXPECT_EQ(session.status(run).message, "not enough memory");
    }
    session.resume(run, {});
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    EXPECT_EQ(session.status(run).passes, 4u);
    EXPECT_EQ(session.status(run).message, "");
}

/// The file of user paths is gone when another seed needs it: the run fails, keeps the seeds that it has, and continues
/// with the file.
TEST(SessionFailures, AFailedSeedCanBeRepeated) {
    const char* paths = R"([{"points": [[0, 0.98, 0], [0.3, -1, 0.2]]}])";
    const TemporaryFolder folder;
    const std::filesystem::path file = folder.path() / "paths.json";
    std::ofstream(file) << paths;
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    RunRequest r = run_of("mlt:groups=2,chains=16", 1);
    r.seeds = 2;
    r.user_paths = file.string();
    const int run = session.start(r);
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }))
        << session.status(run).message;
    const int other = session.start(run_of("path", 1u << 30));
    std::filesystem::remove(file);
    session.resume(run, {});
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Failed; }));
    EXPECT_NE(session.status(run).message.find(file.filename().string()), std::string::npos)
        << session.status(run).message;
    EXPECT_EQ(session.seed_series(run)->luminance.size(), 2u);
    const uint64_t passes = session.status(other).passes;
    EXPECT_TRUE(wait_for([&] { return session.status(other).passes > passes; }));
    session.stop(other);
    std::ofstream(file) << paths;
    session.resume(run, {});
    EXPECT_TRUE(wait_for([&] { return session.status(run).finished_seeds == 4; }));
}

// -- Long passes.

/// A scene whose passes take a while, compared with what is asked for in the meantime.
Scene slow_room() {
    return build(sensor("0,0,3.5", "0,0,0", 200) + room() + area_lamp());
}

/// Saving does not wait for the pass in flight: the file has the passes that are shown.
TEST(Session, SavesDuringAPass) {
    Session session(slow_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = session.start(run_of("bdpt:max_depth=12", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session.status(run).passes == 1; }));
    const Saved answer = saved(session, run);
    EXPECT_EQ(answer.error, "");
    EXPECT_EQ(answer.passes, 1u);
    EXPECT_EQ(session.status(run).passes, 1u);
    session.stop_all(true);
}

TEST(Session, LoadsDuringAPass) {
    std::atomic<int> loads{0};
    Session session(
        [&] {
            ++loads;
            return slow_room();
        },
        1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = session.start(run_of("bdpt:max_depth=12", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session.status(run).passes == 1; }));
    session.reload();
    ASSERT_TRUE(wait_for([&] { return session.scene_version() == 2; }));
    EXPECT_EQ(session.status(run).passes, 1u);
    EXPECT_FALSE(session.status(run).is_of_this_scene);
    session.stop_all(true);
}

/// A pass in flight is traced again while it is traced, so that the answer does not wait for its end: the number of
/// finished passes is then the index of the pass.
TEST(Session, ReplaysDuringAPass) {
    Session session(slow_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = session.start(run_of("vcm:max_depth=12", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session.status(run).passes == 1; }));
    uint32_t pass = 0;
    while (pass == 0) {  // until the second pass is traced
        std::promise<std::pair<uint32_t, uint64_t>> answer;
        session.replay_last(run, 20100, 10, [&](const Replay& r, const std::string& error) {
            EXPECT_EQ(error, "");
            answer.set_value(
                {r.paths.empty() ? 0 : r.paths.front().pass, session.status(run).passes});
        });
        const auto [of_pass, finished] = answer.get_future().get();
        ASSERT_EQ(finished, 1u);
        pass = of_pass;
    }
    EXPECT_EQ(pass, 1u);
    session.stop_all(true);
}

TEST(Session, ReplaysNoPixelOutsideOfTheImage) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    const int run = session.start(run_of("vcm", 2));
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Finished; }));
    for (const uint64_t pixel : {uint64_t(24 * 24), uint64_t(1) << 40}) {
        std::promise<std::string> answer;
        session.replay_last(run, pixel, 10, [&](const Replay&, const std::string& error) {
            answer.set_value(error);
        });
        EXPECT_NE(answer.get_future().get().find("pixel"), std::string::npos);
    }
}

/// Scenes of alternating size are loaded while runs are started: a run that is said to be of the scene has its size.
TEST(Session, RunsBelongToTheSceneTheyAreStartedWith) {
    std::atomic<int> loads{0};
    Session session(
        [&] {
            return build(sensor("0,0,3.5", "0,0,0", ++loads % 2 == 0 ? 8 : 16) + room() +
                         area_lamp());
        },
        1);
    ASSERT_TRUE(wait_for_scene(session));
    for (int i = 0; i < 30; ++i) {
        session.reload();
        for (int j = 0; j < 4; ++j) {
            const int run = session.start(run_of("path", 1));
            ASSERT_TRUE(wait_for([&] {
                const RunState s = session.status(run).state;
                return s == RunState::Finished || s == RunState::Stopped;
            }));
            const auto scene = session.scene();
            const auto shown = session.snapshot(run);
            if (shown && session.status(run).is_of_this_scene && session.scene() == scene) {
                EXPECT_EQ(shown->width, scene->film().crop_width);
            }
            session.remove(run);
        }
    }
}

/// With the first seed under way, its image is shown and saved.
TEST(Session, RunsWithSeveralSeedsShowAllTheirPasses) {
    Session session(small_room, 1);
    ASSERT_TRUE(wait_for_scene(session));
    RunRequest r = run_of("path", 1u << 30);
    r.seeds = 2;
    const int run = session.start(r);
    ASSERT_TRUE(wait_for([&] {
        const auto shown = session.snapshot(run);
        return shown && shown->passes > 2;
    }));
    session.stop(run);
    ASSERT_TRUE(wait_for([&] { return session.status(run).state == RunState::Stopped; }));
    const uint64_t passes = session.status(run).passes;
    EXPECT_EQ(session.snapshot(run)->passes, passes);
    r.spp = passes;
    const std::vector<Rgb> expected = plain_image(small_room(), r);
    for (size_t i = 0; i < expected.size(); ++i)
        for (int c = 0; c < 3; ++c)
            ASSERT_NEAR(session.snapshot(run)->mean[i][c], expected[i][c], 1e-5f);
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
    const int run = session.start(run_of("path", 1u << 30));
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
    constexpr size_t kThreads = 2;
    Workers workers(kThreads);
    size_t taken = 0;
    for (int i = 0; i < 100; ++i)
        taken += workers.post([&] {
            while (!may_end) std::this_thread::sleep_for(1ms);
            ++ended;
        });
    EXPECT_GE(taken, Workers::kMostWaiting);
    EXPECT_LE(taken, Workers::kMostWaiting + kThreads);
    may_end = true;
    EXPECT_TRUE(wait_for([&] { return size_t(ended.load()) == taken; }));
}

}  // namespace
}  // namespace etendue::test
