// supertac-info --chain and supertac-check chain: one bit that is changed anywhere is found, and its link
// named.

#include <nlohmann/json.hpp>
#include <random>

#include "data/recordings/recording.h"
#include "tests/apps/common/expect.h"
#include "tests/support/tensor_file.h"
#include "tests/support/test.h"

namespace supertac::chain_test {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// A model, its C code, and the places where a bit may be changed.
class Chain : public Training {
 protected:
  static void SetUpTestSuite() {
    Training::SetUpTestSuite();
    trained("model.safetensors");
    succeed("supertac-export model.safetensors --c99 code --sensor-hz 50");
  }
  void SetUp() override {
    fs::remove_all(path("changed"));
    fs::create_directory(path("changed"));
    for (const char* name : {"data", "code", "model.safetensors"})
      fs::copy(path(name), path(std::string("changed/") + name), fs::copy_options::recursive);
  }
  static Json checked(const std::string& more = "") {
    const ProcessResult ran = run(
        "supertac-check chain changed/model.safetensors changed/code/finger.h --data changed/data --json - " +
        more);
    Json result = Json::parse(ran.out, nullptr, false);
    EXPECT_FALSE(result.is_discarded()) << ran.out << ran.error;
    EXPECT_EQ(ran.code, result["changed"].empty() ? 0 : 1);
    return result;
  }
  // Below `count`.
  std::size_t drawn(std::size_t count) { return random_() % count; }
  void flip(std::string& text, std::size_t at, std::size_t bits = 8) {
    text[at] = static_cast<char>(text[at] ^ 1 << drawn(bits));
  }
  // Any bit of a file between two places.
  void flip_in_file(const std::string& name, std::size_t begin = 0, std::size_t end = std::string::npos) {
    std::string text = bytes(name);
    flip(text, begin + drawn(std::min(end, text.size()) - begin));
    write_file(path(name), text);
  }
  // A bit of the model, whose checksum is then made anew, as somebody who wants to deceive would do: of a
  // tensor whose name begins so, or does not, or of a field of the metadata.
  void flip_in_model(const std::string& begin, bool begins, bool metadata) {
    TensorFile file(SafetensorsFile::read(path("model.safetensors")));
    for (bool done = false; !done;) {
      if (metadata) {
        const auto field =
            std::next(file.metadata.begin(), static_cast<std::ptrdiff_t>(drawn(file.metadata.size())));
        if (field->second.empty() || field->first == "provenance") continue;
        flip(field->second, drawn(field->second.size()), 5);
      } else {
        TensorFile::Entry& tensor = file.tensors[drawn(file.tensors.size())];
        if (tensor.name.starts_with(begin) != begins) continue;
        tensor.bytes[drawn(tensor.bytes.size())] ^= static_cast<std::byte>(1U << drawn(8));
      }
      done = true;
    }
    file.write(path("changed/model.safetensors"));
  }
  // What is named, by the link of which one bit is changed.
  void plant(const std::string& link, std::size_t number) {
    const std::string c_file = "changed/code/finger.c", h_file = "changed/code/finger.h";
    const std::string header = bytes("code/finger.h");
    std::string more;
    if (number % 5 == 4) {  // the hash that the header states
      const std::string row = link == "picture" ? "SELF_TEST 0x" : "   " + link;
      const std::size_t at = header.find_first_not_of(' ', header.find(row) + row.size());
      const std::size_t digits = link == "picture" ? 16 : 64;
      flip_in_file(h_file, at, at + digits);
    } else if (link == "recordings") {
      const std::vector<std::string> files = list_recordings(path("changed/data"));
      flip_in_file(fs::relative(files[drawn(files.size())], path("")));
    } else if (link == "recipe") {
      flip_in_model("", true, true);
    } else if (link == "model") {
      if (number % 5 < 2) flip_in_file("changed/model.safetensors");
      if (number % 5 >= 2) flip_in_model("int8.", false, false);
    } else if (link == "int8") {
      flip_in_model("int8.", true, false);
    } else if (link == "code" && number % 5 < 2) {
      flip_in_file(c_file);
    } else if (link == "code") {  // what the header declares
      flip_in_file(h_file, header.find("*/") + 3, header.find("#define FINGER_SELF_TEST"));
    } else {
      std::string said = header.substr(header.find("SELF_TEST 0x") + 12, 16);
      flip(said, drawn(16), 4);
      more = "--picture '" + said + "'";
    }
    const Json result = checked(more);
    EXPECT_EQ(result["changed"], Json::array({link})) << link << " " << number << " " << result.dump(1);
  }

 private:
  std::mt19937_64 random_{11};
};

TEST_F(Chain, HoldsFromTheRecordingsToThePicture) {
  const std::string header = bytes("code/finger.h");
  const std::string said = header.substr(header.find("SELF_TEST 0x") + 12, 16);
  const Json result = checked("--picture " + said);
  std::vector<std::string> links;
  for (const Json& row : result["links"]) {
    links.push_back(row["link"]);
    EXPECT_EQ(row["said"], "ok") << row.dump();
  }
  EXPECT_EQ(links, (std::vector<std::string>{"recordings", "recipe", "model", "int8", "code", "picture"}));
  // A training again gives the same; supertac-info prints it, but for the code, which is made for another
  // rate there.
  succeed("supertac-train --recipe-of model.safetensors --data data --out again.safetensors");
  succeed("supertac-check chain again.safetensors code/finger.h --data data");
  const Json chain = Json::parse(succeed("supertac-info --chain model.safetensors --json -").out)["chain"];
  ASSERT_EQ(chain.size(), links.size());
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(chain[i]["hash"], result["links"][i]["found"]);
}

TEST_F(Chain, EveryOneOfAHundredPlantedBitsIsFoundAndItsLinkNamed) {
  for (const auto& [link, count] : {std::pair("recordings", 20),
                                    {"recipe", 15},
                                    {"model", 20},
                                    {"int8", 10},
                                    {"code", 20},
                                    {"picture", 15}})
    for (int i = 0; i < count; ++i) {
      SetUp();
      plant(link, static_cast<std::size_t>(i));
    }
}

}  // namespace supertac::chain_test
