"""Checkpoints in the true architectures with a few thousand random weights, written as the published ones are."""

from __future__ import annotations

import numpy as np
import torch
from safetensors.torch import save_file
from tokenizers import Tokenizer, decoders, models, pre_tokenizers, processors

SIDE_2, SIDE_3 = 128, 56  # px: inputs of the tiny SAM 2 and SAM 3
DIM = 32
WIDE = 128  # of SAM 3: its tracker's memory tokens have 64 channels, fixed, and must be narrower than the rest
MOLMO_TOKENS = (
    "<im_patch>", "<im_col>", "<im_start>", "<low_res_im_start>", "<frame_start>", "<im_end>", "<frame_end>",
    "<im_low>",
    "<|image|>", "<|video|>",
)  # fmt: skip
CHAT = (
    "{% for message in messages %}{% for part in message['content'] %}"
    "{% if part['type'] == 'image' %}<|image|>{% else %}{{ part['text'] }}{% endif %}"
    "{% endfor %}{% endfor %}"
)
WORDS = ("red", "can", "soup", "tall", "basket", "box", "a", "the", "milk", "left")


def seeded(make):
    """What `make` builds, from one seed."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return make()


def letters(**special):
    """A byte-level tokenizer without merges: one token a character."""
    from transformers import PreTrainedTokenizerFast

    vocabulary = {c: i for i, c in enumerate(sorted(pre_tokenizers.ByteLevel.alphabet()))}
    raw = Tokenizer(models.BPE(vocab=vocabulary, merges=[]))
    raw.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    raw.decoder = decoders.ByteLevel()
    return PreTrainedTokenizerFast(tokenizer_object=raw, eos_token="<|end|>", pad_token="<|pad|>", **special)


def sam2(folder):
    from transformers import (
        Sam2Config,
        Sam2HieraDetConfig,
        Sam2MaskDecoderConfig,
        Sam2Model,
        Sam2PromptEncoderConfig,
        Sam2VisionConfig,
    )

    backbone = Sam2HieraDetConfig(
        hidden_size=8, image_size=[SIDE_2, SIDE_2], blocks_per_stage=[1, 1, 2, 1], embed_dim_per_stage=[8, 16, 32, 64],
        num_attention_heads_per_stage=[1, 1, 2, 2], window_size_per_stage=[8, 4, 4, 4], global_attention_blocks=[3],
        window_positional_embedding_background_size=[4, 4],
    )  # fmt: skip
    vision = Sam2VisionConfig(
        backbone_config=backbone, backbone_channel_list=[64, 32, 16, 8], fpn_hidden_size=DIM,
        backbone_feature_sizes=[[32, 32], [16, 16], [8, 8]],
    )  # fmt: skip
    prompt = Sam2PromptEncoderConfig(hidden_size=DIM, image_size=SIDE_2, mask_input_channels=8)
    decoder = Sam2MaskDecoderConfig(hidden_size=DIM, mlp_dim=DIM, num_attention_heads=2, iou_head_hidden_dim=16)
    config = Sam2Config(vision_config=vision, prompt_encoder_config=prompt, mask_decoder_config=decoder)
    seeded(lambda: Sam2Model(config)).save_pretrained(folder)


def sam3(folder):
    """Detector and tracker in one checkpoint, its tensors named as the published file names them."""
    from transformers import (
        CLIPTextConfig,
        Sam3Config,
        Sam3VideoConfig,
        Sam3VideoModel,
        Sam3VisionConfig,
        Sam3ViTConfig,
    )
    from transformers.models.sam3.configuration_sam3 import (
        Sam3DETRDecoderConfig,
        Sam3DETREncoderConfig,
        Sam3GeometryEncoderConfig,
        Sam3MaskDecoderConfig,
    )
    from transformers.models.sam3_tracker_video.configuration_sam3_tracker_video import (
        Sam3TrackerVideoConfig,
        Sam3TrackerVideoMaskDecoderConfig,
        Sam3TrackerVideoPromptEncoderConfig,
    )

    def vision():
        backbone = Sam3ViTConfig(
            hidden_size=DIM, intermediate_size=DIM, num_hidden_layers=2, num_attention_heads=2, image_size=SIDE_3,
            window_size=2, global_attn_indexes=[1], pretrain_image_size=28,
        )  # fmt: skip
        sizes = [[16, 16], [8, 8], [4, 4]]
        return Sam3VisionConfig(backbone_config=backbone, fpn_hidden_size=WIDE, backbone_feature_sizes=sizes)

    small = {"hidden_size": WIDE, "num_layers": 1, "num_attention_heads": 2, "intermediate_size": WIDE}
    words = letters()
    detector = Sam3Config(
        vision_config=vision(),
        text_config=CLIPTextConfig(
            vocab_size=len(words), hidden_size=WIDE, intermediate_size=WIDE, projection_dim=16, num_hidden_layers=1,
            num_attention_heads=2, max_position_embeddings=32, eos_token_id=words.eos_token_id,
        ),
        geometry_encoder_config=Sam3GeometryEncoderConfig(**small),
        detr_encoder_config=Sam3DETREncoderConfig(**small),
        detr_decoder_config=Sam3DETRDecoderConfig(**small, num_queries=6),
        mask_decoder_config=Sam3MaskDecoderConfig(hidden_size=WIDE, num_attention_heads=2),
    )  # fmt: skip
    tracker = Sam3TrackerVideoConfig(
        vision_config=vision(), image_size=SIDE_3, num_maskmem=3, max_object_pointers_in_encoder=4,
        prompt_encoder_config=Sam3TrackerVideoPromptEncoderConfig(
            hidden_size=WIDE, image_size=SIDE_3, mask_input_channels=8
        ),
        mask_decoder_config=Sam3TrackerVideoMaskDecoderConfig(
            hidden_size=WIDE, mlp_dim=WIDE, num_attention_heads=2, iou_head_hidden_dim=16
        ),
        memory_attention_hidden_size=WIDE, memory_attention_num_layers=1, memory_attention_rope_feat_sizes=[4, 4],
        memory_attention_feed_forward_hidden_size=WIDE, memory_encoder_hidden_size=WIDE,
        memory_encoder_output_channels=WIDE // 2,
        mask_downsampler_embed_dim=WIDE, memory_fuser_embed_dim=WIDE, memory_fuser_intermediate_dim=WIDE,
    )  # fmt: skip
    config = Sam3VideoConfig(detector_config=detector, tracker_config=tracker)
    network = seeded(lambda: Sam3VideoModel(config))
    network.config.save_pretrained(folder)
    tensors = {name: value.clone().contiguous() for name, value in network.state_dict().items()}
    save_file(tensors, folder / "model.safetensors", metadata={"format": "pt"})
    words.save_pretrained(folder)


def grounding_dino(folder):
    from transformers import (
        BertConfig,
        GroundingDinoConfig,
        GroundingDinoForObjectDetection,
        GroundingDinoProcessor,
        PreTrainedTokenizerFast,
        SwinConfig,
    )
    from transformers.models.grounding_dino.image_processing_pil_grounding_dino import GroundingDinoImageProcessorPil

    ids = {
        "[PAD]": 0,
        "[UNK]": 100,
        "[CLS]": 101,
        "[SEP]": 102,
        ".": 1012,
        "?": 1029,
    }  # the network knows these by number
    ids |= {word: 2000 + i for i, word in enumerate(WORDS)}
    raw = Tokenizer(models.WordPiece(vocab=ids, unk_token="[UNK]"))
    raw.pre_tokenizer = pre_tokenizers.BertPreTokenizer()
    raw.post_processor = processors.BertProcessing(("[SEP]", 102), ("[CLS]", 101))
    words = PreTrainedTokenizerFast(
        tokenizer_object=raw, pad_token="[PAD]", unk_token="[UNK]", cls_token="[CLS]", sep_token="[SEP]"
    )
    config = GroundingDinoConfig(
        backbone_config=SwinConfig(
            embed_dim=8, depths=[1, 1, 1, 1], num_heads=[1, 1, 2, 2], window_size=4, image_size=64,
            out_features=["stage2", "stage3", "stage4"],
        ),
        text_config=BertConfig(
            vocab_size=2100, hidden_size=DIM, num_hidden_layers=1, num_attention_heads=2, intermediate_size=DIM
        ),
        d_model=DIM, encoder_layers=1, decoder_layers=2, encoder_attention_heads=2, decoder_attention_heads=2,
        encoder_ffn_dim=DIM, decoder_ffn_dim=DIM, num_queries=8, max_text_len=24,
    )  # fmt: skip
    seeded(lambda: GroundingDinoForObjectDetection(config)).save_pretrained(folder)
    images = GroundingDinoImageProcessorPil(size={"shortest_edge": 64, "longest_edge": 96})
    GroundingDinoProcessor(images, words).save_pretrained(folder)


def owl(folder, generation):
    """OWL-ViT (1) or OWLv2 (2)."""
    import transformers

    kind = {1: "OwlViT", 2: "Owlv2"}[generation]
    module = getattr(transformers.models, kind.lower())
    images = getattr(
        __import__(f"{module.__name__}.image_processing_pil_{kind.lower()}", fromlist=["x"]), f"{kind}ImageProcessorPil"
    )(size={"height": 64, "width": 64})
    words = letters(model_max_length=16)
    small = {"hidden_size": DIM, "intermediate_size": DIM, "num_hidden_layers": 1, "num_attention_heads": 2}
    config = getattr(transformers, f"{kind}Config")(
        text_config={**small, "vocab_size": len(words), "max_position_embeddings": 16},
        vision_config={**small, "image_size": 64, "patch_size": 16},
        projection_dim=DIM,
    )
    seeded(lambda: getattr(transformers, f"{kind}ForObjectDetection")(config)).save_pretrained(folder)
    getattr(transformers, f"{kind}Processor")(images, words).save_pretrained(folder)


def molmo(folder):
    from transformers import Molmo2Config, Molmo2ForConditionalGeneration
    from transformers.models.molmo2.configuration_molmo2 import (
        Molmo2AdapterConfig,
        Molmo2TextConfig,
        Molmo2VisionConfig,
    )
    from transformers.models.molmo2.image_processing_molmo2 import Molmo2ImageProcessor

    words = letters(additional_special_tokens=list(MOLMO_TOKENS))
    words.chat_template = CHAT
    number = words.convert_tokens_to_ids
    heads = {"num_attention_heads": 2, "num_key_value_heads": 2, "head_dim": 16, "hidden_size": DIM}
    config = Molmo2Config(
        text_config=Molmo2TextConfig(
            **heads, vocab_size=len(words), additional_vocab_size=8, num_hidden_layers=1, intermediate_size=DIM,
            max_position_embeddings=4096,
        ),
        vision_config=Molmo2VisionConfig(
            **heads, intermediate_size=DIM, num_hidden_layers=2, image_size=[28, 28], patch_size=7
        ),
        adapter_config=Molmo2AdapterConfig(
            **heads, vision_feature_layer=[1, 0], intermediate_size=DIM, text_hidden_size=DIM
        ),
        image_start_token_id=number("<im_start>"), low_res_image_start_token_id=number("<low_res_im_start>"),
        image_end_token_id=number("<im_end>"), image_patch_id=number("<im_patch>"),
        frame_start_token_id=number("<frame_start>"), frame_end_token_id=number("<frame_end>"),
    )  # fmt: skip
    network = seeded(lambda: Molmo2ForConditionalGeneration(config))
    network.generation_config.eos_token_id = words.eos_token_id
    network.generation_config.pad_token_id = words.pad_token_id
    network.save_pretrained(folder)
    Molmo2ImageProcessor(
        size={"height": 28, "width": 28}, patch_size=7, max_crops=2, overlap_margins=[1, 1]
    ).save_pretrained(folder)
    words.save_pretrained(folder)


def picture(rows=48, columns=80, box=(20, 10, 60, 30), seed=0):
    """Grey noise with one bright rectangle, (rows, columns, 3) bytes."""
    pixels = np.random.default_rng(seed).integers(20, 60, (rows, columns, 3), dtype=np.uint8)
    x0, y0, x1, y1 = box
    pixels[y0:y1, x0:x1] = 250
    return pixels
