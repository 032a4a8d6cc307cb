// Runs that are kept in a folder: they go on in another session with the same bits, or are only looked at; files of others
// stay as they are.

#include <algorithm>
#include <atomic>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <future>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render/checkpoint.h"
#include "render/method_choice.h"
#include "run_program.h"
#include "run_request.h"
#include "session/session.h"
#include "test_scenes.h"
#include "wait_for.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kFingerprint = 7;

LoadedScene kept_room() {
    return {build(sensor("0,0,3.5", "0,0,0", 24) + room() + area_lamp()),
            {.fingerprint = kFingerprint}};
}

RenderSettings settings_for(const std::string& integrator, uint64_t spp) {
    RenderSettings s = settings_of(run_of(integrator, spp), IntegratorSpec::parse(integrator));
    s.threads = 1;
    return s;
}

class KeptRuns : public ::testing::Test {
protected:
    void open_session(double every = 60, const Session::Load& load = kept_room) {
        session.reset();
        session.emplace(load, 1, RunKeeping{.folder = folder.path().string(), .every = every});
        ASSERT_TRUE(wait_for([&] { return session->scene() != nullptr; }));
    }
    bool is_in(int run, RunState state) {
        return wait_for([&] { return session->status(run).state == state; });
    }
    /// The id of a run of `spp` passes that has ended.
    int finished(const RunRequest& request) {
        const int run = session->start(request);
        EXPECT_TRUE(is_in(run, RunState::Finished)) << session->status(run).message;
        session->settle();
        return run;
    }
    Opened open(const std::string& name) {
        std::promise<Opened> answer;
        session->open(name, [&](const Opened& opened) { answer.set_value(opened); });
        return answer.get_future().get();
    }
    /// What the folder has of the scene, once it has `count` files.
    std::vector<KeptRun> listed(size_t count) {
        const uint64_t before = session->kept_version();
        session->list_kept();
        EXPECT_TRUE(wait_for([&] {
            return session->kept_version() > before && session->kept().size() == count;
        })) << session->kept().size();
        return session->kept();
    }
    void continue_to(int run, uint64_t spp) {
        RenderLimits limits;
        limits.spp = spp;
        session->resume(run, limits);
        EXPECT_TRUE(wait_for([&] {
            const RunStatus s = session->status(run);
            return s.passes == spp && s.state == RunState::Finished;
        }));
        session->settle();
    }
    std::string bytes(const std::string& name) const { return read_text(folder.path() / name); }
    /// A file as `render` writes it, of 16 passes; `build`: another value of that condition.
    void write_checkpoint(const std::string& name, const std::string& build = "") const {
        const LoadedScene loaded = kept_room();
        const RenderSettings settings = settings_for("bdpt", 16);
        Renderer renderer(loaded.scene, settings);
        PassLog log;
        renderer.run([&](const Progress& p) { log.add(p.seconds, 0); }, std::atomic<bool>(false));
        Conditions conditions = conditions_of(renderer, loaded.scene, loaded.source, settings);
        for (auto& [condition, value] : conditions)
            if (condition == "build" && !build.empty()) value = build;
        written_checkpoint((folder.path() / name).string(), renderer, loaded.scene, conditions,
                           settings, log)
            ->commit();
    }

    TemporaryFolder folder;
    std::optional<Session> session;
};

void expect_equal(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
    ASSERT_EQ(a.size(), b.size());
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(Rgb)), 0);
}

std::vector<Rgb> plain_image(const std::string& integrator, uint64_t spp) {
    const Scene scene = kept_room().scene;
    Renderer renderer(scene, settings_for(integrator, spp));
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    return renderer.film().image();
}

/// Independent passes, passes that learn, and chains.
class KeptMethods : public KeptRuns, public ::testing::WithParamInterface<const char*> {};

TEST_P(KeptMethods, GoOnInAnotherSessionWithTheSameBits) {
    open_session();
    RunRequest request = run_of(GetParam(), 16);
    request.technique_depth = std::string(GetParam()) == "bdpt" ? 3 : 0;
    const int first = finished(request);
    const RunStatus before = session->status(first);
    EXPECT_EQ(before.file_passes, 16u) << before.file_problem;
    EXPECT_NE(before.history.empty(), before.error.valid);
    const auto shown = session->snapshot(first);

    open_session();
    const std::vector<KeptRun> kept = listed(1);
    ASSERT_EQ(kept.size(), 1u);
    EXPECT_EQ(kept[0].file, before.file);
    EXPECT_EQ(kept[0].integrator, before.request.integrator);
    EXPECT_EQ(kept[0].passes, 16u);
    const Opened opened = open(kept[0].file);
    ASSERT_EQ(opened.error, "");
    EXPECT_EQ(open(kept[0].file).run, opened.run) << "it is open already";
    EXPECT_TRUE(session->kept().empty());
    const RunStatus after = session->status(opened.run);
    EXPECT_EQ(after.why_look_only, "");
    EXPECT_EQ(after.state, RunState::Finished);
    EXPECT_EQ(after.passes, 16u);
    EXPECT_EQ(after.request.spp, 16u);
    EXPECT_EQ(after.request.integrator, before.request.integrator);
    EXPECT_EQ(after.interval, before.interval);
    EXPECT_EQ(after.seconds, before.seconds);
    EXPECT_EQ(after.error.relative_rms, before.error.relative_rms);
    ASSERT_EQ(after.history.size(), before.history.size());
    for (size_t i = 0; i < after.history.size(); ++i) {
        EXPECT_EQ(after.history[i].passes, before.history[i].passes);
        EXPECT_EQ(after.history[i].seconds, before.history[i].seconds);
        EXPECT_EQ(after.history[i].error.relative_rms, before.history[i].error.relative_rms);
    }
    expect_equal(session->snapshot(opened.run)->mean, shown->mean);
    expect_equal(session->snapshot(opened.run)->variance, shown->variance);
    EXPECT_EQ(after.request.technique_depth, request.technique_depth);
    if (request.technique_depth > 0) {
        EXPECT_TRUE(wait_for([&] { return session->techniques(opened.run) != nullptr; }));
    }

    continue_to(opened.run, 21);
    expect_equal(session->snapshot(opened.run)->mean, plain_image(GetParam(), 21));
    // The same file again.
    EXPECT_EQ(session->status(opened.run).file, before.file);
    EXPECT_EQ(session->status(opened.run).file_passes, 21u);
    session->remove(opened.run);
    session->settle();
    const std::vector<KeptRun> again = listed(1);
    EXPECT_EQ(again[0].passes, 21u);
}

INSTANTIATE_TEST_SUITE_P(Methods, KeptMethods,
                         ::testing::Values("path", "bdpt", "upg", "mlt:groups=2,chains=16"));

TEST_F(KeptRuns, AreSavedAtStopsWhileTheyRenderAndAtTheEnd) {
    open_session(0);
    const int run = session->start(run_of("path", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session->status(run).file_passes > 2; }));
    EXPECT_EQ(session->status(run).state, RunState::Rendering);
    session->stop(run);
    ASSERT_TRUE(is_in(run, RunState::Stopped));
    session->settle();
    RunStatus status = session->status(run);
    EXPECT_EQ(status.file_passes, status.passes);
    open_session();
    ASSERT_EQ(open(status.file).error, "");
    session->resume(1, {});
    ASSERT_TRUE(wait_for([&] { return session->status(1).passes > status.passes + 2; }));
    session->close(false);
    session->settle();
    status = session->status(1);
    EXPECT_EQ(status.file_passes, status.passes);
    // At the end of the session, too.
    open_session();
    const int other = session->start(run_of("light", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session->status(other).passes > 0; }));
    session.reset();
    EXPECT_GT(CheckpointFile((folder.path() / "test-light-1.etd").string()).header().passes(), 0u);
}

/// More than files can wait for their writer.
TEST_F(KeptRuns, AllOfManyAreSaved) {
    open_session();
    constexpr int kRuns = 2 * int(Workers::kMostWaiting);
    for (int i = 0; i < kRuns; ++i) {
        const int run = session->start(run_of("path", 1u << 30));
        ASSERT_TRUE(wait_for([&] { return session->status(run).passes > 0; }));
    }
    session->close(false);
    session->settle();
    for (const RunStatus& s : session->runs()) {
        EXPECT_EQ(s.file_passes, s.passes) << s.file_problem;
        EXPECT_EQ(CheckpointFile((folder.path() / s.file).string()).header().passes(), s.passes);
    }
}

TEST_F(KeptRuns, NeedAFolder) {
    session.emplace(kept_room, 1);
    ASSERT_TRUE(wait_for([&] { return session->scene() != nullptr; }));
    EXPECT_EQ(session->status(finished(run_of("path", 2))).file, "");
    EXPECT_TRUE(fs::is_empty(folder.path()));
    EXPECT_THROW(session->open("test-path-1.etd", [](const Opened&) {}), std::runtime_error);
}

/// Seeds that are shorter than the time between two files do not keep a run from being saved.
TEST_F(KeptRuns, OfShortSeedsAreKeptWhileTheyRender) {
    open_session(0.2);
    RunRequest several = run_of("path", 32);
    several.seeds = 64;
    const int run = session->start(several);
    RunStatus s;
    EXPECT_TRUE(wait_for([&] {
        s = session->status(run);
        return s.file_passes > 0 || s.state != RunState::Rendering;
    }));
    EXPECT_EQ(s.state, RunState::Rendering) << s.message;
    EXPECT_GT(s.file_passes, 0u) << s.file_problem;
    session->discard(run);
}

/// Opened in another session, a run with several seeds has the same images, and goes on with more seeds.
TEST_F(KeptRuns, OfSeveralSeedsGoOn) {
    RunRequest several = run_of("path", 4);
    several.seeds = 3;
    several.seed = 5;
    session.emplace(kept_room, 1);
    ASSERT_TRUE(wait_for([&] { return session->scene() != nullptr; }));
    const int whole = finished(several);
    const auto image = session->snapshot(whole);
    const auto series = session->seed_series(whole);
    ASSERT_EQ(series->luminance.size(), 3u);

    open_session();
    int run = finished(several);
    for (const char* when : {"all seeds", "more seeds"}) {
        SCOPED_TRACE(when);
        const RunStatus before = session->status(run);
        ASSERT_EQ(before.file_problem, "");
        ASSERT_EQ(before.file_passes, before.passes);
        const auto shown = session->snapshot(run);
        open_session();
        const auto is_kept = [&](const KeptRun& k) {
            return k.file == before.file && k.seeds == before.seeds &&
                   k.finished_seeds == before.finished_seeds && k.passes == before.passes;
        };
        ASSERT_TRUE(wait_for([&] {
            const std::vector<KeptRun> kept = session->kept();
            return std::any_of(kept.begin(), kept.end(), is_kept);
        }));
        const Opened opened = open(before.file);
        ASSERT_EQ(opened.error, "");
        run = opened.run;
        const RunStatus after = session->status(run);
        EXPECT_EQ(after.why_look_only, "");
        EXPECT_EQ(after.request.seed, 5u);
        EXPECT_EQ(after.seeds, before.seeds);
        EXPECT_EQ(after.finished_seeds, before.finished_seeds);
        EXPECT_EQ(after.passes, before.passes);
        EXPECT_DOUBLE_EQ(after.seconds, before.seconds);
        expect_equal(session->snapshot(run)->mean, shown->mean);
        expect_equal(session->snapshot(run)->variance, shown->variance);
        if (after.finished_seeds == 3) {
            expect_equal(shown->mean, image->mean);
            for (size_t i = 0; i < 3; ++i)
                EXPECT_EQ(*session->seed_series(run)->luminance[i], *series->luminance[i]);
        }
        session->resume(run, {});
        ASSERT_TRUE(wait_for([&] {
            const RunStatus s = session->status(run);
            return s.state == RunState::Finished && s.finished_seeds == s.seeds &&
                   s.seeds == 2 * before.seeds;
        }));
        session->settle();
    }
    EXPECT_EQ(session->seed_series(run)->luminance.size(), 12u);
}

/// The state of the seed under way is kept, too.
TEST_F(KeptRuns, GoOnWithinASeed) {
    open_session();
    RunRequest several = run_of("path", 1u << 30);
    several.seeds = 2;
    const int run = session->start(several);
    ASSERT_TRUE(wait_for([&] { return session->status(run).passes > 0; }));
    session->stop(run);
    ASSERT_TRUE(is_in(run, RunState::Stopped));
    session->settle();
    const RunStatus before = session->status(run);
    open_session();
    const Opened opened = open(before.file);
    ASSERT_EQ(opened.error, "");
    EXPECT_EQ(session->status(opened.run).passes, before.passes);
    EXPECT_EQ(session->status(opened.run).finished_seeds, 0);
    expect_equal(session->snapshot(opened.run)->mean, plain_image("path", before.passes));
    session->resume(opened.run, {});
    ASSERT_TRUE(wait_for([&] { return session->status(opened.run).passes > before.passes; }));
    session->discard(opened.run);
    ASSERT_TRUE(is_in(opened.run, RunState::Stopped));
    session->settle();
    const uint64_t passes = session->status(opened.run).passes;
    expect_equal(session->snapshot(opened.run)->mean, plain_image("path", passes));
}

TEST_F(KeptRuns, ReplaceNoFilesOfOthers) {
    std::ofstream(folder.path() / "test-bdpt-1.etd") << "mine";
    fs::create_symlink(folder.path() / "nowhere", folder.path() / "test-bdpt-2.etd");
    write_checkpoint("test-bdpt-3.etd");
    const std::string of_render = bytes("test-bdpt-3.etd");
    open_session();
    const int run = finished(run_of("bdpt", 2));
    EXPECT_EQ(session->status(run).file, "test-bdpt-4.etd");
    // Another program writes there.
    std::ofstream(folder.path() / "test-bdpt-4.etd") << "other";
    continue_to(run, 3);
    EXPECT_EQ(session->status(run).file, "test-bdpt-5.etd");
    // What another command has written goes on elsewhere.
    const Opened opened = open("test-bdpt-3.etd");
    ASSERT_EQ(opened.error, "");
    EXPECT_EQ(session->status(opened.run).why_look_only, "");
    EXPECT_EQ(session->status(opened.run).history.size(), 1u);
    continue_to(opened.run, 19);
    expect_equal(session->snapshot(opened.run)->mean, plain_image("bdpt", 19));
    EXPECT_EQ(session->status(opened.run).file, "test-bdpt-6.etd");

    EXPECT_EQ(bytes("test-bdpt-1.etd"), "mine");
    EXPECT_EQ(bytes("test-bdpt-3.etd"), of_render);
    EXPECT_EQ(bytes("test-bdpt-4.etd"), "other");
    EXPECT_FALSE(fs::exists(folder.path() / "nowhere"));
}

TEST_F(KeptRuns, OfAnotherBuildAreLookedAt) {
    write_checkpoint("old.etd", "another");
    open_session();
    const Opened opened = open("old.etd");
    ASSERT_EQ(opened.error, "");
    const RunStatus status = session->status(opened.run);
    EXPECT_NE(status.why_look_only.find("build: \"another\" there"), std::string::npos)
        << status.why_look_only;
    EXPECT_EQ(status.state, RunState::Stopped);
    EXPECT_TRUE(status.error.valid);
    EXPECT_GT(status.rays_per_second, 0);
    expect_equal(session->snapshot(opened.run)->mean, plain_image("bdpt", 16));
    ASSERT_TRUE(session->snapshot(opened.run)->report);
    try {
        session->resume(opened.run, {});
        ADD_FAILURE() << "it goes on";
    } catch (const std::runtime_error& e) {
        EXPECT_NE(std::string(e.what()).find("only be looked at"), std::string::npos) << e.what();
    }
    // Commands that need no renderer are harmless.
    session->stop(opened.run);
    session->discard(opened.run);
    std::promise<std::string> answer;
    session->replay_last(opened.run, 5, 10,
                         [&](const Replay&, const std::string& error) { answer.set_value(error); });
    EXPECT_NE(answer.get_future().get().find("looked at"), std::string::npos);
    session->settle();
    EXPECT_EQ(session->status(opened.run).state, RunState::Stopped);
    session->remove(opened.run);
    listed(1);
}

TEST_F(KeptRuns, AreListedIfTheyAreOfTheScene) {
    write_checkpoint("good.etd");
    const std::string whole = bytes("good.etd");
    std::ofstream(folder.path() / "cut.etd", std::ios::binary) << whole.substr(0, whole.size() / 2);
    std::ofstream(folder.path() / "text.etd") << "no state of a rendering";
    std::ofstream(folder.path() / "empty.etd");
    std::ofstream(folder.path() / "other.txt") << whole;
    fs::create_symlink(folder.path() / "good.etd", folder.path() / "link.etd");
    fs::create_directory(folder.path() / "folder.etd");
    open_session();
    std::vector<KeptRun> kept = listed(3);
    std::sort(kept.begin(), kept.end(),
              [](const KeptRun& a, const KeptRun& b) { return a.file < b.file; });
    EXPECT_EQ(kept[0].file, "cut.etd");
    EXPECT_NE(kept[0].problem.find("cut.etd"), std::string::npos);
    EXPECT_EQ(kept[1].file, "good.etd");
    EXPECT_EQ(kept[1].problem, "");
    EXPECT_EQ(kept[2].file, "text.etd");
    for (const char* bad : {"cut.etd", "text.etd", "empty.etd", "missing.etd"})
        EXPECT_NE(open(bad).error.find(bad), std::string::npos) << bad;
    EXPECT_TRUE(session->runs().empty());

    // Another scene, and another part of it.
    const auto other_scene = [] {
        LoadedScene loaded = kept_room();
        loaded.source.fingerprint = kFingerprint + 1;
        return loaded;
    };
    const auto other_size = []() -> LoadedScene {
        return {build(sensor("0,0,3.5", "0,0,0", 20) + room() + area_lamp()),
                {.fingerprint = kFingerprint}};
    };
    for (const Session::Load& load : {Session::Load(other_scene), Session::Load(other_size)}) {
        open_session(60, load);
        listed(2);
        EXPECT_NE(open("good.etd").error.find("not of this scene"), std::string::npos);
    }
}

TEST_F(KeptRuns, WhatCannotBeSavedIsSaidAndSavedLater) {
    const fs::path runs = folder.path() / "runs";
    session.emplace(kept_room, 1, RunKeeping{.folder = runs.string()});
    ASSERT_TRUE(wait_for([&] { return session->scene() != nullptr; }));
    const int run = finished(run_of("path", 2));
    RunStatus status = session->status(run);
    EXPECT_EQ(status.state, RunState::Finished);
    EXPECT_NE(status.file_problem.find(runs.string()), std::string::npos) << status.file_problem;
    EXPECT_EQ(status.file, "");
    fs::create_directory(runs);
    continue_to(run, 3);
    status = session->status(run);
    EXPECT_EQ(status.file_problem, "");
    EXPECT_EQ(status.file, "test-path-1.etd");
    EXPECT_EQ(status.file_passes, 3u);
}

/// Methods that share light paths have those of the last pass again after one more.
TEST_F(KeptRuns, TracePathsAgainAfterAnotherPass) {
    open_session();
    const std::string file = session->status(finished(run_of("vcm", 3))).file;
    open_session();
    const int run = open(file).run;
    const auto problem = [&] {
        std::promise<std::string> answer;
        session->replay_last(run, 300, 10, [&](const Replay&, const std::string& error) {
            answer.set_value(error);
        });
        return answer.get_future().get();
    };
    EXPECT_NE(problem().find("opened from a file"), std::string::npos);
    continue_to(run, 4);
    EXPECT_EQ(problem(), "");
}

TEST_F(KeptRuns, KeepWhatAutoHasChosen) {
    open_session();
    const int run = session->start(run_of("auto", 1u << 30));
    ASSERT_TRUE(wait_for([&] { return session->status(run).passes > 0; }));
    session->stop(run);
    ASSERT_TRUE(is_in(run, RunState::Stopped));
    session->settle();
    const RunStatus before = session->status(run);
    ASSERT_TRUE(before.choice);
    EXPECT_EQ(before.request.integrator, before.choice->chosen);
    EXPECT_EQ(before.choice->candidates.front().method, before.choice->chosen);
    open_session();
    const Opened opened = open(before.file);
    ASSERT_EQ(opened.error, "");
    const RunStatus after = session->status(opened.run);
    EXPECT_EQ(after.why_look_only, "");
    EXPECT_EQ(after.request.integrator, before.request.integrator);
    ASSERT_TRUE(after.choice);
    EXPECT_EQ(after.choice->to_json(), before.choice->to_json());
}

}  // namespace
}  // namespace etendue::test
