// Checkpoints: a rendering goes on from one with the same bits, and sums of several are those of their passes.

#include "render/checkpoint.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <string_view>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "error_of.h"
#include "render/merging.h"
#include "render/method_choice.h"
#include "render/render_request.h"
#include "resumable.h"
#include "system/section_file.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

/// Everything that a rendering leaves, apart from times and sizes in memory.
struct Outcome {
    std::vector<Rgb> image, variance;
    ErrorEstimate error;
    Film::MeanEstimate mean;
    std::vector<TechniqueImages::Entry> techniques;
    nlohmann::json report;
    std::string film;                       ///< All that is kept of it.
    std::map<std::string, double> figures;  ///< Of the last pass, once there is one.

    explicit Outcome(const Renderer& r)
        : image(r.film().image()), variance(r.film().variance()), error(r.film().error()),
          mean(r.film().mean_luminance()),
          report(statistics(r.film(), r.stats(), r.seconds(), error)) {
        SectionWriter to;
        r.film().save(to);
        film = to.take();
        if (r.techniques()) techniques = r.techniques()->images();
        for (const char* time :
             {"seconds", "samples_per_second", "rays_per_second", "phase_seconds"})
            report.erase(time);
        for (const auto& [name, value] : r.integrator().figures())
            if (!name.ends_with("_seconds") && !name.ends_with("_bytes")) figures[name] = value;
    }
};

void expect_equal(const Outcome& a, const Outcome& b) {
    // Not EXPECT_EQ, which would print thousands of numbers.
    EXPECT_TRUE(a.image == b.image);
    EXPECT_TRUE(a.variance == b.variance);
    EXPECT_EQ(a.error.valid, b.error.valid);
    EXPECT_EQ(a.error.relative_rms, b.error.relative_rms);
    EXPECT_EQ(a.error.low, b.error.low);
    EXPECT_EQ(a.error.high, b.error.high);
    EXPECT_EQ(a.mean.mean, b.mean.mean);
    EXPECT_EQ(a.mean.standard_error, b.mean.standard_error);
    ASSERT_EQ(a.techniques.size(), b.techniques.size());
    for (size_t i = 0; i < a.techniques.size(); ++i) {
        EXPECT_EQ(a.techniques[i].technique, b.techniques[i].technique);
        EXPECT_TRUE(a.techniques[i].weighted == b.techniques[i].weighted) << i;
        EXPECT_TRUE(a.techniques[i].unweighted == b.techniques[i].unweighted) << i;
    }
    EXPECT_EQ(a.report, b.report);
    EXPECT_TRUE(a.film == b.film);
}

/// One rendering after the other in files of a folder.
class Renderings {
public:
    explicit Renderings(const Scene& scene) : scene_(scene) {
        std::string name = (fs::temp_directory_path() / "etendue-test-XXXXXX").string();
        folder_ = ::mkdtemp(name.data());
    }
    ~Renderings() { fs::remove_all(folder_); }

    std::string file(const std::string& name) const { return (folder_ / name).string(); }
    /// Renders until there are `passes`, and writes a checkpoint.
    std::string render(const std::string& name, const RenderSettings& settings,
                       uint64_t passes) const {
        Renderer r(scene_, settings);
        PassLog log;
        run(r, passes, log);
        write(name, r, settings, log);
        return file(name);
    }
    void run(Renderer& r, uint64_t passes, PassLog& log) const {
        RenderLimits limits;
        limits.spp = passes;
        r.run(
            limits, [&](const Progress& p) { log.add(p.seconds, r.stats().pairs); },
            std::atomic<bool>{false});
    }
    Conditions conditions(const Renderer& r, const RenderSettings& settings) const {
        return conditions_of(r, scene_, {}, settings);
    }
    void write(const std::string& name, const Renderer& r, const RenderSettings& settings,
               const PassLog& log) const {
        written_checkpoint(file(name), r, scene_, conditions(r, settings), settings, log)->commit();
    }
    /// Loads a checkpoint and renders until there are `passes`.
    Outcome resume(const std::string& name, const RenderSettings& settings, uint64_t passes) const {
        Renderer r(scene_, settings);
        PassLog log;
        CheckpointFile(file(name)).resume(r, conditions(r, settings), log);
        EXPECT_EQ(log.seconds.size(), r.film().passes());
        run(r, passes, log);
        EXPECT_EQ(log.seconds.size(), passes);
        return Outcome(r);
    }

private:
    const Scene& scene_;
    fs::path folder_;
};

RenderSettings settings_of(const char* method) {
    RenderSettings s;
    s.integrator = IntegratorSpec::parse(method);
    s.sampler = SamplerKind::Sobol;
    s.threads = 2;
    return s;
}

class Checkpoints : public ::testing::TestWithParam<const char*> {};

/// A filter that reaches other pixels.
Scene with_wide_filter(const std::string& body) {
    return build(with_filter(body, "gaussian"));
}

TEST_P(Checkpoints, GiveTheSameBits) {
    const uint64_t refit = refit_pass(GetParam());
    const Scene scene =
        with_wide_filter(refit > 0 ? lantern_room(lens_camera(image_size(GetParam())))
                                   : mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    RenderSettings settings = settings_of(GetParam());
    settings.technique_depth = 4;
    // Enough for an estimate of the error.
    const uint64_t last = refit > 0 ? refit + 2 : 13;
    for (const FilterMode mode : {FilterMode::Spread, FilterMode::Sample}) {
        SCOPED_TRACE(to_string(mode));
        settings.filter_mode = mode;
        const std::vector<uint64_t> stops = refit > 0 ? std::vector<uint64_t>{1, refit - 1, refit}
                                                      : std::vector<uint64_t>{1, 2, 3, 4, 5, 8, 13};
        Renderer whole(scene, settings);
        PassLog log;
        for (const uint64_t passes : stops) {
            renderings.run(whole, passes, log);
            renderings.write(std::to_string(passes), whole, settings, log);
        }
        renderings.run(whole, last, log);
        const Outcome expected(whole);
        EXPECT_TRUE(expected.error.valid || whole.film().groups() == 2);
        for (const uint64_t passes : stops) {
            SCOPED_TRACE(passes);
            const Outcome resumed = renderings.resume(std::to_string(passes), settings, last);
            expect_equal(resumed, expected);
            if (passes < last) {
                EXPECT_EQ(resumed.figures, expected.figures);
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Methods, Checkpoints, ::testing::ValuesIn(resumable_methods()),
                         name_of_method);

TEST(Checkpoint, AllIntegratorsAreTested) {
    for (const IntegratorEntry& e : integrator_registry()) {
        const std::string& name = e.info.name;
        const bool has_guide =
            std::any_of(e.info.params.begin(), e.info.params.end(),
                        [](const ParamInfo& p) { return std::string_view(p.name) == "guide"; });
        bool is_tested = false, is_tested_with_guide = false;
        for (const std::string_view method : resumable_methods()) {
            if (method.substr(0, method.find(':')) != name) continue;
            is_tested = true;
            is_tested_with_guide |= method.find("guide=on") != std::string_view::npos;
        }
        EXPECT_TRUE(is_tested) << name;
        EXPECT_EQ(is_tested_with_guide, has_guide) << name;
    }
}

TEST(Checkpoint, GivesTheSameBitsWithOtherThreadsAndSamplers) {
    const Scene scene = with_wide_filter(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
        RenderSettings settings = settings_of("upg+bdpt");
        settings.sampler = sampler;
        Renderer whole(scene, settings);
        PassLog log;
        renderings.run(whole, 3, log);
        renderings.write("a", whole, settings, log);
        renderings.run(whole, 6, log);
        settings.threads = 3;
        expect_equal(renderings.resume("a", settings, 6), Outcome(whole));
    }
}

/// What the last pass did not have is not taken from an earlier one. Here, half of the light paths meet nothing.
TEST(Checkpoint, PassesWithoutLightVerticesAreRemembered) {
    const Scene scene =
        build(sensor("0,0,6", "0,0,0", 6) +
              "<emitter type=\"point\"><point name=\"position\" x=\"0\" y=\"0\" z=\"3\"/>"
              "<rgb name=\"intensity\" value=\"30\"/></emitter>" +
              sphere("0,0,0", "1.4", diffuse("0.5,0.5,0.5")) +
              rectangle("<scale value=\"100\"/><translate z=\"-2\"/>", diffuse("0.5,0.5,0.5")));
    const Renderings renderings(scene);
    for (const char* method : {"upg:light_paths=1", "upg+bdpt:light_paths=1",
                               "vcm:light_paths=1,exact=true", "vcm:light_paths=1"})
        for (uint64_t seed = 0; seed < 12; ++seed) {
            SCOPED_TRACE(fmt::format("{}, {}", method, seed));
            RenderSettings settings = settings_of(method);
            settings.seed = seed;
            settings.threads = 1;
            Renderer whole(scene, settings);
            PassLog log;
            renderings.run(whole, 8, log);
            // Integrators learn from pass 3 before pass 4.
            renderings.render("a", settings, 3);
            expect_equal(renderings.resume("a", settings, 8), Outcome(whole));
        }
}

/// A rendering that goes on has no pilots, and the same bits.
TEST(Checkpoint, HasTheChoiceOfAGuide) {
    const Scene scene = build(front_camera(56) + room() + area_lamp());
    const Renderings renderings(scene);
    RenderSettings settings = settings_of("path:guide=auto");
    settings.spp = 4000;
    const RenderSettings chosen = with_chosen_method(scene, settings);
    ASSERT_TRUE(chosen.choice);
    EXPECT_GT(chosen.choice->candidates.front().images, 0);
    EXPECT_EQ(chosen.choice->candidates.size(), 2u);
    Renderer whole(scene, chosen);
    PassLog log;
    renderings.run(whole, 5, log);
    renderings.render("a", chosen, 2);
    const auto read = MethodChoice::from_json(CheckpointFile(renderings.file("a")).header().choice);
    settings.spp = 5;  // too few for pilots
    expect_equal(renderings.resume("a", with_chosen_method(settings, read), 5), Outcome(whole));
}

/// A checkpoint that is written after such a failure must have them, too.
TEST(Checkpoint, ChainsThatCannotBeLoadedAreKept) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    Renderer saved(scene, settings_of("mlt:groups=4,chains=48")),
        other(scene, settings_of("mlt:groups=4,chains=32"));
    const Renderings renderings(scene);
    PassLog log;
    renderings.run(saved, 2, log);
    SectionWriter state;
    saved.save(state);
    SectionReader reader(state.take(), "state");
    other.load(reader);
    EXPECT_NE(error_of([&] { renderings.run(other, 3, log); }).find("of other chains"),
              std::string::npos);
    EXPECT_EQ(other.film().passes(), 2u);
    LearnedState before, after;
    saved.integrator().save(before);
    other.integrator().save(after);
    EXPECT_TRUE(before.bytes() == after.bytes());
}

/// Names of files may hold any bytes, but the header is text.
TEST(Checkpoint, HasTheChoiceOfAMethodWhateverFilesAreCalled) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    RenderSettings settings = settings_of("auto:chains=false,user_paths=\xff.json");
    settings.spp = 3;
    renderings.render("a", with_chosen_method(scene, settings), 3);
    const auto read = MethodChoice::from_json(CheckpointFile(renderings.file("a")).header().choice);
    const RenderSettings again = with_chosen_method(settings, read);
    renderings.resume("a", again, 4);
    // The file itself keeps its name.
    const MethodChoice of_paths{
        .asked = read.asked, .chosen = "mlt:user_paths=\xff.json", .candidates = {}};
    EXPECT_EQ(with_chosen_method(settings, MethodChoice::from_json(of_paths.to_text()))
                  .integrator.params.at("user_paths"),
              "\xff.json");
}

/// The message with which a checkpoint is refused.
std::string refusal(const Renderings& renderings, const Scene& scene, const std::string& name,
                    const RenderSettings& settings) {
    try {
        Renderer r(scene, settings);
        PassLog log;
        CheckpointFile(renderings.file(name)).resume(r, renderings.conditions(r, settings), log);
    } catch (const std::runtime_error& e) {
        return e.what();
    }
    return "";
}

TEST(Checkpoint, IsRefusedWithBothValuesWhereBitsWouldDiffer) {
    const Scene scene = with_wide_filter(mixed_room(lens_camera(16))),
                larger = with_wide_filter(mixed_room(lens_camera(24)));
    const Renderings renderings(scene), of_larger(larger);
    const RenderSettings settings = settings_of("bdpt:max_depth=5");
    renderings.render("a", settings, 1);
    EXPECT_EQ(refusal(renderings, scene, "a", settings), "");
    const auto expect_refused_as = [&](const std::string& name, const RenderSettings& other,
                                       const char* theirs, const char* own) {
        const std::string message = refusal(renderings, scene, name, other);
        EXPECT_NE(message.find(renderings.file(name)), std::string::npos) << message;
        EXPECT_NE(message.find(theirs), std::string::npos) << message;
        EXPECT_NE(message.find(own), std::string::npos) << message;
    };
    const auto expect_refused = [&](const RenderSettings& other, const char* theirs,
                                    const char* own) {
        expect_refused_as("a", other, theirs, own);
    };
    RenderSettings other = settings;
    other.seed = 3;
    expect_refused(other, "seed: \"0\"", "\"3\"");
    other = settings;
    other.sampler = SamplerKind::Independent;
    expect_refused(other, "sampler: \"sobol\"", "\"independent\"");
    other = settings_of("bdpt:max_depth=6");
    expect_refused(other, "max_depth=5", "max_depth=6");
    other = settings_of("path:max_depth=5");
    expect_refused(other, "\"bdpt:", "\"path:");
    other = settings;
    other.technique_depth = 3;
    expect_refused(other, "technique images: \"none\"", "up to 3 edges");
    other = settings;
    other.first_pass = 2;
    expect_refused(other, "first pass: \"0\"", "\"2\"");
    other = settings;
    other.filter_mode = FilterMode::Sample;
    expect_refused(other, "filter mode: \"spread\"", "\"sample\"");

    Renderer r(scene, settings);
    PassLog log;
    Conditions changed = renderings.conditions(r, settings);
    for (auto& [name, value] : changed)
        if (name == "scene contents" || name == "build" || name == "ray tracer" ||
            name == "processor")
            value = "other";
    try {
        CheckpointFile(renderings.file("a")).resume(r, changed, log);
        ADD_FAILURE();
    } catch (const std::runtime_error& e) {
        for (const char* name : {"scene contents", "build", "ray tracer", "processor"})
            EXPECT_NE(std::string(e.what()).find(name), std::string::npos) << e.what();
    }
    fs::copy_file(of_larger.render("b", settings, 1), renderings.file("b"));
    expect_refused_as("b", settings, "image: \"24 x 24\"", "\"16 x 16\"");
}

TEST(Checkpoint, ParametersThatAreDefaultsNeedNotBeGiven) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    renderings.render("a", settings_of("bdpt"), 1);
    EXPECT_EQ(refusal(renderings, scene, "a", settings_of("bdpt:max_depth=-1,eorr=false")), "");
}

// -- Sums.

RenderTotals merged(const Renderings& renderings, const std::vector<std::string>& names) {
    std::vector<CheckpointFile> parts;
    for (const std::string& name : names) parts.emplace_back(renderings.file(name));
    return Merging(std::move(parts)).totals();
}

std::string merge_refusal(const Renderings& renderings, const std::vector<std::string>& names) {
    try {
        merged(renderings, names);
    } catch (const std::runtime_error& e) {
        return e.what();
    }
    return "";
}

TEST(Merge, DoesNotDependOnTheOrder) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    for (const char* method : {"bdpt", "upg+bdpt", "mlt:groups=4,chains=48"}) {
        RenderSettings settings = settings_of(method);
        settings.technique_depth = 3;
        for (const uint64_t seed : {0, 1, 2}) {
            settings.seed = seed;
            renderings.render(std::to_string(seed), settings, 10 + seed);
        }
        const RenderTotals a = merged(renderings, {"0", "1", "2"}),
                           b = merged(renderings, {"2", "0", "1"});
        EXPECT_EQ(a.film->passes(), 33u);
        EXPECT_EQ(a.film->image(), b.film->image());
        EXPECT_EQ(a.film->variance(), b.film->variance());
        EXPECT_EQ(a.film->error().relative_rms, b.film->error().relative_rms);
        EXPECT_EQ(a.stats.rays(), b.stats.rays());
        const auto x = a.techniques->images(), y = b.techniques->images();
        ASSERT_EQ(x.size(), y.size());
        for (size_t i = 0; i < x.size(); ++i) EXPECT_EQ(x[i].weighted, y[i].weighted);
    }
}

TEST(Merge, OfRangesOfAMethodWithIndependentPassesIsOneRendering) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    // Without Russian roulette, which knows earlier passes.
    RenderSettings settings = settings_of("path");
    settings.technique_depth = 3;
    Renderer whole(scene, settings);
    PassLog log;
    renderings.run(whole, 12, log);
    renderings.render("a", settings, 4);
    settings.first_pass = 4;
    renderings.render("b", settings, 8);
    const RenderTotals sum = merged(renderings, {"b", "a"});
    ASSERT_EQ(sum.film->passes(), 12u);
    const std::vector<Rgb> expected = whole.film().image(), image = sum.film->image();
    for (size_t i = 0; i < image.size(); ++i)
        for (int c = 0; c < 3; ++c)
            ASSERT_NEAR(image[i][c], expected[i][c], 1e-6f * expected[i][c]);
    EXPECT_EQ(sum.stats.walk_rays, whole.stats().walk_rays);
    EXPECT_EQ(sum.stats.shadow_rays, whole.stats().shadow_rays);
    const auto x = sum.techniques->images(), y = whole.techniques()->images();
    ASSERT_EQ(x.size(), y.size());
    for (size_t i = 0; i < x.size(); ++i)
        for (size_t p = 0; p < x[i].weighted.size(); ++p)
            ASSERT_NEAR(x[i].weighted[p].g, y[i].weighted[p].g, 1e-5f * y[i].weighted[p].g);
}

TEST(Merge, RangesOfMethodsThatLearnHaveOtherNumbers) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    for (const char* method :
         {"upg+bdpt", "vcm", "mlt:groups=4,chains=48", "pcbpt", "sppm", "ppm",
          "upg+pssmlt:groups=2,chains=16", "bdpt", "path:guide=on,guide_walks=4000"}) {
        RenderSettings settings = settings_of(method);
        renderings.render("a", settings, 1);
        settings.first_pass = 1;
        renderings.render("b", settings, 1);
        settings.first_pass = 2;
        renderings.render("c", settings, 1);
        const auto a = merged(renderings, {"a"}).film->image(),
                   b = merged(renderings, {"b"}).film->image(),
                   c = merged(renderings, {"c"}).film->image();
        EXPECT_NE(a, b) << method;
        EXPECT_NE(b, c) << method;
        EXPECT_EQ(merged(renderings, {"a", "b", "c"}).film->passes(), 3u);
    }
}

TEST(Merge, RadiiOfRangesGoOn) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    // Without Russian roulette, the image of a pass depends on its index by its radius and its random numbers alone.
    RenderSettings settings = settings_of("sppm:roulette=0");
    Renderer whole(scene, settings);
    PassLog log;
    renderings.run(whole, 2, log);
    const std::vector<Rgb> two = whole.film().image();
    renderings.render("a", settings, 1);
    settings.first_pass = 1;
    renderings.render("b", settings, 1);
    const auto sum = merged(renderings, {"a", "b"}).film->image();
    for (size_t i = 0; i < sum.size(); ++i)
        ASSERT_NEAR(sum[i].g, two[i].g, 1e-5f * two[i].g + 1e-7f);
}

TEST(Merge, ErrorsAreThoseOfAllPasses) {
    // Without rare bright paths, which would make the true error of one image a matter of luck.
    const Scene scene = build(front_camera(16) + room() + "<emitter type=\"constant\"/>");
    const Renderings renderings(scene);
    constexpr uint64_t kPasses = 16, kMore = 4;
    for (const char* method : {"bdpt", "mlt:groups=8,chains=256,mutations=8"}) {
        RenderSettings settings = settings_of(method);
        settings.sampler = SamplerKind::Independent;
        std::vector<std::string> names;
        double error2_of_parts = 0;
        for (const uint64_t seed : {0, 1, 2, 3}) {
            settings.seed = seed;
            names.push_back(std::to_string(seed));
            renderings.render(names.back(), settings, kPasses);
            error2_of_parts +=
                std::pow(merged(renderings, {names.back()}).film->error().relative_rms, 2);
        }
        const RenderTotals sum = merged(renderings, names);
        const ErrorEstimate e = sum.film->error();
        ASSERT_TRUE(e.valid);
        EXPECT_LT(e.low, e.relative_rms);
        EXPECT_NEAR(e.relative_rms / std::sqrt(error2_of_parts) * double(names.size()), 1, 0.25)
            << method;
        // The true error, from a rendering with more passes, whose own error adds to it.
        settings.seed = 9;
        Renderer reference(scene, settings);
        PassLog log;
        renderings.run(reference, kMore * names.size() * kPasses, log);
        const auto image = sum.film->image(), expected = reference.film().image();
        double mean = 0, error = 0;
        for (const Rgb& v : expected) mean += double(luminance(v)) / double(expected.size());
        for (size_t i = 0; i < image.size(); ++i) {
            const double I = double(luminance(expected[i]));
            error += std::pow(double(luminance(image[i])) - I, 2) / (I * I + 0.01 * mean * mean);
        }
        error = std::sqrt(error / double(image.size()) / (1 + 1 / double(kMore)));
        EXPECT_LT(error / e.relative_rms, 1.25) << method;
        EXPECT_GT(error / e.relative_rms, 0.75) << method;
    }
}

TEST(Merge, InStagesHasTheSamePasses) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    RenderSettings settings = settings_of("bdpt");
    for (const uint64_t seed : {0, 1, 2}) {
        settings.seed = seed;
        renderings.render(std::to_string(seed), settings, 8);
    }
    std::vector<CheckpointFile> two;
    for (const char* name : {"2", "0"}) two.emplace_back(renderings.file(name));
    Merging merging(std::move(two));
    merging.write(renderings.file("02"), merging.totals());
    const RenderTotals staged = merged(renderings, {"1", "02"}),
                       at_once = merged(renderings, {"0", "1", "2"});
    EXPECT_EQ(staged.film->passes(), 24u);
    const auto a = staged.film->image(), b = at_once.film->image();
    for (size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i].g, b[i].g, 1e-6f * b[i].g);
    const ErrorEstimate e = staged.film->error(), f = at_once.film->error();
    ASSERT_TRUE(e.valid);
    EXPECT_NEAR(e.relative_rms, f.relative_rms, 1e-6 * f.relative_rms);
    EXPECT_NEAR(e.high, f.high, 1e-6 * f.high);
    EXPECT_NE(merge_refusal(renderings, {"02", "2"}), "");
    Renderer r(scene, settings);
    EXPECT_NE(refusal(renderings, scene, "02", settings).find("sum of several"), std::string::npos);
}

/// Also of one rendering alone.
TEST(Merge, NothingGoesOnFromSums) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    const RenderSettings settings = settings_of("bdpt");
    renderings.render("a", settings, 1);
    EXPECT_TRUE(CheckpointFile(renderings.file("a")).has_state());
    std::vector<CheckpointFile> parts;
    parts.emplace_back(renderings.file("a"));
    Merging merging(std::move(parts));
    merging.write(renderings.file("sums"), merging.totals());
    EXPECT_FALSE(CheckpointFile(renderings.file("sums")).has_state());
    Renderer r(scene, settings);
    PassLog log;
    renderings.run(r, 1, log);
    CheckpointFile partial(SectionReader(
        partial_result(r, scene, renderings.conditions(r, settings), settings, log), "partial"));
    EXPECT_FALSE(partial.has_state());
    Renderer other(scene, settings);
    EXPECT_EQ(error_of([&] { partial.resume(other, renderings.conditions(r, settings), log); }),
              "partial cannot be resumed: it contains the sums of a rendering, but not its state");
    EXPECT_NE(refusal(renderings, scene, "sums", settings).find("but not its state"),
              std::string::npos);
}

TEST(Merge, RefusesWhatDoesNotBelongTogether) {
    const Scene scene = build(mixed_room(lens_camera(16))),
                larger = build(mixed_room(lens_camera(24)));
    const Renderings renderings(scene);
    RenderSettings settings = settings_of("bdpt");
    renderings.render("a", settings, 4);
    const Renderings of_larger(larger);
    settings.seed = 1;
    fs::copy_file(of_larger.render("b", settings, 1), renderings.file("larger"));
    settings.first_pass = 3;
    settings.seed = 0;
    renderings.render("overlap", settings, 2);
    settings = settings_of("path");
    settings.seed = 1;
    renderings.render("path", settings, 4);
    EXPECT_NE(merge_refusal(renderings, {"a", "a"}).find("share passes"), std::string::npos);
    const std::string overlap = merge_refusal(renderings, {"a", "overlap"});
    EXPECT_NE(overlap.find("passes 0:4 of seed 0"), std::string::npos) << overlap;
    EXPECT_NE(overlap.find("passes 3:5 of seed 0"), std::string::npos) << overlap;
    EXPECT_NE(merge_refusal(renderings, {"a", "larger"}).find("24 x 24"), std::string::npos);
    EXPECT_NE(merge_refusal(renderings, {"a", "path"}).find("\"path:"), std::string::npos);
}

/// What changes nothing but last bits may differ.
TEST(Merge, TakesPartsOfOtherMachines) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    RenderSettings settings = settings_of("bdpt");
    renderings.render("a", settings, 2);
    settings.seed = 1;
    Renderer r(scene, settings);
    PassLog log;
    renderings.run(r, 2, log);
    const auto write_with_other = [&](std::string_view condition) {
        Conditions conditions = renderings.conditions(r, settings);
        for (auto& [name, value] : conditions)
            if (name == condition) value = "other";
        written_checkpoint(renderings.file("b"), r, scene, conditions, settings, log)->commit();
    };
    for (const char* condition : {"build", "C library", "ray tracer", "processor"}) {
        write_with_other(condition);
        EXPECT_EQ(merge_refusal(renderings, {"a", "b"}), "") << condition;
    }
    write_with_other("scene contents");
    EXPECT_NE(merge_refusal(renderings, {"a", "b"}).find("scene contents"), std::string::npos);
}

TEST(Merge, WarnsWhereSeedsDoNotReduceABias) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    const Renderings renderings(scene);
    const auto warnings_of = [&](const char* method, uint64_t seed, uint64_t first) {
        RenderSettings settings = settings_of(method);
        renderings.render("a", settings, 1);
        settings.seed = seed;
        settings.first_pass = first;
        renderings.render("b", settings, 1);
        std::vector<CheckpointFile> parts;
        for (const char* name : {"a", "b"}) parts.emplace_back(renderings.file(name));
        return Merging(std::move(parts)).warnings().size();
    };
    EXPECT_EQ(warnings_of("bdpt", 1, 0), 0u);
    EXPECT_EQ(warnings_of("mlt:groups=4,chains=48", 1, 0), 0u);
    EXPECT_EQ(warnings_of("vcm", 1, 0), 1u);
    EXPECT_EQ(warnings_of("vcm", 0, 1), 0u);
    EXPECT_EQ(warnings_of("sppm", 1, 0), 1u);
    EXPECT_EQ(warnings_of("pm:light_paths=2000", 1, 0), 1u);
    EXPECT_EQ(warnings_of("pm:light_paths=2000", 0, 1), 1u);
}

}  // namespace
}  // namespace etendue::test
